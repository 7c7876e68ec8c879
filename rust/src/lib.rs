//! Euler-Lagrange dynamics of constant-curvature, pneumatic bellows arms.
