"""Equations of motion of the true arm, from the Jacobians of its mass points and bodies.

What: ``M s'' + h = Q`` in the coordinates ``s = (u_1, v_1, l_1, u_2, ...)``, linear in the bellows lengths, with

    M = sum m J^T J + J_w^T I J_w,   h = sum m J^T (dJ/dt s') + J_w^T (I (dJ_w/dt s') + w x I w)

over the heads, the mass slices along the arcs and the payloads. Every Jacobian column is a screw about the base origin:
a point ``x`` that a coordinate carries along moves by ``e + w x x``. ``dJ/dt s'`` is the acceleration of the point at
``s'' = 0``, in closed form from the second directional derivative of the arc.
Source: eqs. (16)-(35), (48)-(53) of the paper; both force models of the project's model page.
Frame: base frame, z along the straight arm, ``gravity`` is the acceleration of free fall. Signs: every per-bellows
force here is positive when it lengthens the bellows, hidden forces come in as resistances and are subtracted.
Limits: sections of constant curvature, or of two arcs of unequal curvature (``curvature_split`` other than 0.5).
"""

from typing import Any

import numpy as np

from .arc import (
    ANGULAR_SECOND,
    ANGULAR_U,
    ANGULAR_V,
    BY_L,
    BY_U,
    BY_V,
    POSITION,
    ROTATION,
    SECOND,
    evaluate_arc,
)
from .hidden import (
    S_PAYLOAD,
    S_PERIODIC,
    S_SPLIT,
    S_TORSION,
    Hidden,
    area_factor,
    bellows_resistance,
    bending_resistance,
    contact_force,
    spring_factor,
    tool_force,
)
from .jit import compiled
from .plant import (
    H_POSITION,
    H_ROTATION,
    H_VELOCITY,
    P_AREA,
    P_BENDING,
    P_CENTER,
    P_DAMPING,
    P_HARDENING,
    P_INERTIA,
    P_MASS,
    P_RADIUS,
    P_REST,
    P_SLICED,
    P_STIFFNESS,
    Array,
    Plant,
    Work,
)


@compiled
def _point_columns(screw: Any, column: Any, columns: int, x: float, y: float, z: float) -> None:
    """Jacobian columns of a point that all coordinates below ``columns`` carry along."""
    for c in range(columns):
        column[c, 0] = screw[c, 0] + screw[c, 4] * z - screw[c, 5] * y
        column[c, 1] = screw[c, 1] + screw[c, 5] * x - screw[c, 3] * z
        column[c, 2] = screw[c, 2] + screw[c, 3] * y - screw[c, 4] * x


@compiled
def _add_point_mass(
    column: Any,
    columns: int,
    mass: float,
    gravity: Any,
    ax: float,
    ay: float,
    az: float,
    matrix: Any,
    bias: Any,
    force: Any,
) -> None:
    """Add ``m J^T J``, ``m J^T a`` and ``m J^T g`` of the point whose columns are in ``column``."""
    for c in range(columns):
        jx, jy, jz = mass * column[c, 0], mass * column[c, 1], mass * column[c, 2]
        bias[c] += jx * ax + jy * ay + jz * az
        force[c] += jx * gravity[0] + jy * gravity[1] + jz * gravity[2]
        for k in range(c + 1):
            matrix[c, k] += jx * column[k, 0] + jy * column[k, 1] + jz * column[k, 2]


@compiled
def _add_force(column: Any, columns: int, fx: float, fy: float, fz: float, force: Any) -> None:
    for c in range(columns):
        force[c] += column[c, 0] * fx + column[c, 1] * fy + column[c, 2] * fz


@compiled
def _turn(a: Any, row0: float, row1: float, row2: float) -> tuple[float, float, float]:
    return (
        a[0, 0] * row0 + a[0, 1] * row1 + a[0, 2] * row2,
        a[1, 0] * row0 + a[1, 1] * row1 + a[1, 2] * row2,
        a[2, 0] * row0 + a[2, 1] * row1 + a[2, 2] * row2,
    )


@compiled
def evaluate(  # noqa: PLR0912, PLR0915 - one sweep; compiled code in one piece is five times faster
    plant: Plant,
    hidden: Hidden,
    work: Work,
    coordinates: Array,
    rates: Array,
    pressure: Array,
    tip_force: Array,
    head_force: Array,
    time: float,
    lengths: Array,
    length_rates: Array,
    stretch: Array,
    span: float,
    memory: Array,
) -> None:
    """Fill ``work`` with M, h, Q, head poses and head velocities.

    ``tip_force`` (3,) acts on the last head in the base frame, ``head_force`` (n, 3) at the centres of mass in the
    frames of their heads. ``stretch`` is the change of the bellows lengths since the hidden states ``memory`` were
    valid, ``span`` the time since.
    """
    ps, slices, ambient, work_conjugate = plant
    hb, hs, whole = hidden
    arc, screw, column, matrix, bias, force, head, frames, bellows = work
    axes, axes_new = frames[0], frames[1]
    n = ps.shape[0]
    d = 3 * n
    matrix[:, :] = 0.0
    bias[:] = 0.0
    force[:] = 0.0

    # Forces along the bellows.
    for i in range(n):
        for k in range(3):
            j = 3 * i + k
            x = lengths[j] - ps[i, P_REST]
            spring = x * (ps[i, P_STIFFNESS] + x * (ps[i, P_STIFFNESS + 1] + x * ps[i, P_STIFFNESS + 2]))
            if ps[i, P_HARDENING] != 0.0:
                x0 = ps[i, P_HARDENING + 1]
                spring += ps[i, P_HARDENING] * x0 * (np.sinh(x / x0) - x / x0)
            spring *= spring_factor(hb, j, x, time)
            gauge = pressure[j] - ambient
            bellows[i, k] = (
                ps[i, P_AREA] * area_factor(hb, j, x, gauge) * gauge
                - spring
                - ps[i, P_DAMPING] * length_rates[j]
                - bellows_resistance(hb, j, length_rates[j], stretch[j], span, memory)
            )

    # Base of the piece at hand: origin, velocity, acceleration at s'' = 0, and the same of the rotation.
    ox, oy, oz = 0.0, 0.0, 0.0
    vx, vy, vz = 0.0, 0.0, 0.0
    bx, by, bz = 0.0, 0.0, 0.0
    wx, wy, wz = 0.0, 0.0, 0.0
    qx, qy, qz = 0.0, 0.0, 0.0
    axes[:, :] = 0.0
    for k in range(3):
        axes[k, k] = 1.0
    h = 0.5 * np.sqrt(3.0)

    for i in range(n):
        c0 = 3 * i
        for c in range(c0, c0 + 3):
            for k in range(6):
                screw[c, k] = 0.0
        u, v, length = coordinates[c0], coordinates[c0 + 1], coordinates[c0 + 2]
        du, dv, dl = rates[c0], rates[c0 + 1], rates[c0 + 2]
        split = hs[i, S_SPLIT]
        pieces = 1 if split == 0.5 else 2
        for piece in range(pieces):
            bend = 1.0 if pieces == 1 else (split if piece == 0 else 1.0 - split)
            part = 1.0 if pieces == 1 else 0.5
            count = slices.shape[0] if ps[i, P_SLICED] > 0.0 else 0
            for m in range(count + 1):
                f = slices[m, 0] if m < count else 1.0
                fb = f * bend
                fl = f * part
                evaluate_arc(fb * u, fb * v, fl * length, fb * du, fb * dv, fl * dl, arc)
                px, py, pz = _turn(axes, arc[POSITION, 0], arc[POSITION, 1], arc[POSITION, 2])
                sx, sy, sz = _turn(axes, arc[SECOND, 0], arc[SECOND, 1], arc[SECOND, 2])
                ux, uy, uz = _turn(axes, fb * arc[BY_U, 0], fb * arc[BY_U, 1], fb * arc[BY_U, 2])
                tx, ty, tz = _turn(axes, fb * arc[BY_V, 0], fb * arc[BY_V, 1], fb * arc[BY_V, 2])
                lx, ly, lz = _turn(axes, fl * arc[BY_L, 0], fl * arc[BY_L, 1], fl * arc[BY_L, 2])
                # Velocity against the moving frame, then the usual composition of accelerations.
                rx, ry, rz = ux * du + tx * dv + lx * dl, uy * du + ty * dv + ly * dl, uz * du + tz * dv + lz * dl
                kx, ky, kz = wy * pz - wz * py, wz * px - wx * pz, wx * py - wy * px
                ax = bx + qy * pz - qz * py + wy * kz - wz * ky + 2.0 * (wy * rz - wz * ry) + sx
                ay = by + qz * px - qx * pz + wz * kx - wx * kz + 2.0 * (wz * rx - wx * rz) + sy
                az = bz + qx * py - qy * px + wx * ky - wy * kx + 2.0 * (wx * ry - wy * rx) + sz
                if m < count:
                    x, y, z = ox + px, oy + py, oz + pz
                    _point_columns(screw, column, c0 + 3, x, y, z)
                    column[c0, 0] += ux
                    column[c0, 1] += uy
                    column[c0, 2] += uz
                    column[c0 + 1, 0] += tx
                    column[c0 + 1, 1] += ty
                    column[c0 + 1, 2] += tz
                    column[c0 + 2, 0] += lx
                    column[c0 + 2, 1] += ly
                    column[c0 + 2, 2] += lz
                    share = ps[i, P_MASS] * ps[i, P_SLICED] * slices[m, 1] * part
                    _add_point_mass(column, c0 + 3, share, whole, ax, ay, az, matrix, bias, force)
                    continue

                # End of the piece: new frame, and the screws of this section's coordinates about the base origin.
                nx, ny, nz = ox + px, oy + py, oz + pz
                vx, vy, vz = vx + kx + rx, vy + ky + ry, vz + kz + rz
                bx, by, bz = ax, ay, az
                gx, gy, gz = _turn(axes, fb * arc[ANGULAR_U, 0], fb * arc[ANGULAR_U, 1], fb * arc[ANGULAR_U, 2])
                hx, hy, hz = _turn(axes, fb * arc[ANGULAR_V, 0], fb * arc[ANGULAR_V, 1], fb * arc[ANGULAR_V, 2])
                ix, iy, iz = _turn(axes, arc[ANGULAR_SECOND, 0], arc[ANGULAR_SECOND, 1], arc[ANGULAR_SECOND, 2])
                for a in range(3):
                    for b in range(3):
                        axes_new[a, b] = (
                            axes[a, 0] * arc[ROTATION, b]
                            + axes[a, 1] * arc[ROTATION + 1, b]
                            + axes[a, 2] * arc[ROTATION + 2, b]
                        )
                axes[:, :] = axes_new
                mx, my, mz = gx * du + hx * dv, gy * du + hy * dv, gz * du + hz * dv
                qx, qy, qz = qx + wy * mz - wz * my + ix, qy + wz * mx - wx * mz + iy, qz + wx * my - wy * mx + iz
                wx, wy, wz = wx + mx, wy + my, wz + mz
                screw[c0, 0] += ux - (gy * nz - gz * ny)
                screw[c0, 1] += uy - (gz * nx - gx * nz)
                screw[c0, 2] += uz - (gx * ny - gy * nx)
                screw[c0 + 1, 0] += tx - (hy * nz - hz * ny)
                screw[c0 + 1, 1] += ty - (hz * nx - hx * nz)
                screw[c0 + 1, 2] += tz - (hx * ny - hy * nx)
                screw[c0 + 2, 0] += lx
                screw[c0 + 2, 1] += ly
                screw[c0 + 2, 2] += lz
                screw[c0, 3] += gx
                screw[c0, 4] += gy
                screw[c0, 5] += gz
                screw[c0 + 1, 3] += hx
                screw[c0 + 1, 4] += hy
                screw[c0 + 1, 5] += hz
                ox, oy, oz = nx, ny, nz

        # Torsion: the head turns about its own axis with the section's length (kinematic, no state of its own).
        twist = hs[i, S_TORSION]
        if twist != 0.0 or hs[i, S_TORSION + 1] != 0.0:
            zx, zy, zz = axes[0, 2], axes[1, 2], axes[2, 2]
            angle = hs[i, S_TORSION + 1] + twist * (length - ps[i, P_REST])
            ca, sa = np.cos(angle), np.sin(angle)
            for a in range(3):
                p0, p1 = axes[a, 0], axes[a, 1]
                axes[a, 0] = p0 * ca + p1 * sa
                axes[a, 1] = -p0 * sa + p1 * ca
            spin = twist * dl
            qx, qy, qz = (
                qx + spin * (wy * zz - wz * zy),
                qy + spin * (wz * zx - wx * zz),
                qz + spin * (wx * zy - wy * zx),
            )
            wx, wy, wz = wx + spin * zx, wy + spin * zy, wz + spin * zz
            screw[c0 + 2, 3] += twist * zx
            screw[c0 + 2, 4] += twist * zy
            screw[c0 + 2, 5] += twist * zz
            screw[c0 + 2, 0] -= twist * (zy * oz - zz * oy)
            screw[c0 + 2, 1] -= twist * (zz * ox - zx * oz)
            screw[c0 + 2, 2] -= twist * (zx * oy - zy * ox)

        columns = c0 + 3
        for a in range(3):
            for b in range(3):
                head[i, H_ROTATION + 3 * a + b] = axes[a, b]
        head[i, H_POSITION], head[i, H_POSITION + 1], head[i, H_POSITION + 2] = ox, oy, oz
        head[i, H_VELOCITY], head[i, H_VELOCITY + 1], head[i, H_VELOCITY + 2] = vx, vy, vz

        # Head body: translation of its centre of mass, rotation about it; then the payload, a point beyond the head.
        for body in range(2):
            if body == 0:
                mass = ps[i, P_MASS] * (1.0 - ps[i, P_SLICED])
                cx, cy, cz = _turn(axes, ps[i, P_CENTER], ps[i, P_CENTER + 1], ps[i, P_CENTER + 2])
            else:
                mass = hs[i, S_PAYLOAD]
                if mass == 0.0:
                    continue
                cx, cy, cz = _turn(axes, hs[i, S_PAYLOAD + 1], hs[i, S_PAYLOAD + 2], hs[i, S_PAYLOAD + 3])
            kx, ky, kz = wy * cz - wz * cy, wz * cx - wx * cz, wx * cy - wy * cx
            ax = bx + qy * cz - qz * cy + wy * kz - wz * ky
            ay = by + qz * cx - qx * cz + wz * kx - wx * kz
            az = bz + qx * cy - qy * cx + wx * ky - wy * kx
            _point_columns(screw, column, columns, ox + cx, oy + cy, oz + cz)
            _add_point_mass(column, columns, mass, whole, ax, ay, az, matrix, bias, force)
            if body == 0:
                fx, fy, fz = _turn(axes, head_force[i, 0], head_force[i, 1], head_force[i, 2])
                if i == n - 1:
                    fx, fy, fz = fx + tip_force[0], fy + tip_force[1], fz + tip_force[2]
                _add_force(column, columns, fx, fy, fz, force)
        _add_rotation(axes, screw, column, ps[i], columns, wx, wy, wz, qx, qy, qz, matrix, bias)

        # Forces of the surroundings on the head's origin.
        fx, fy, fz = contact_force(hs, i, ox, oy, oz, vx, vy, vz)
        if i == n - 1:
            gx, gy, gz = tool_force(whole, ox, oy, oz, vx, vy, vz)
            fx, fy, fz = fx + gx, fy + gy, fz + gz
        swing = hs[i, S_PERIODIC]
        if swing != 0.0:
            swing *= np.sin(2.0 * np.pi * hs[i, S_PERIODIC + 1] * time + hs[i, S_PERIODIC + 2])
            fx += swing * np.cos(hs[i, S_PERIODIC + 3])
            fy += swing * np.sin(hs[i, S_PERIODIC + 3])
        need_head = not work_conjugate
        if need_head or fx != 0.0 or fy != 0.0 or fz != 0.0:
            _point_columns(screw, column, columns, ox, oy, oz)
            _add_force(column, columns, fx, fy, fz, force)
        if need_head:
            # Net force and moment of F z at r_B (cos a_k, sin a_k) of the head, sections above pushing back.
            f0 = bellows[i, 0] - bellows[i + 1, 0]
            f1 = bellows[i, 1] - bellows[i + 1, 1]
            f2 = bellows[i, 2] - bellows[i + 1, 2]
            r = ps[i, P_RADIUS]
            total = f0 + f1 + f2
            _add_force(column, columns, axes[0, 2] * total, axes[1, 2] * total, axes[2, 2] * total, force)
            gx, gy, gz = _turn(axes, r * h * (f1 - f2), -r * (f0 - 0.5 * (f1 + f2)), 0.0)
            for c in range(columns):
                force[c] += screw[c, 3] * gx + screw[c, 4] * gy + screw[c, 5] * gz
        else:
            f0, f1, f2 = bellows[i, 0], bellows[i, 1], bellows[i, 2]
            r = ps[i, P_RADIUS]
            force[c0] += r * (0.5 * (f1 + f2) - f0)
            force[c0 + 1] += r * h * (f2 - f1)
            force[c0 + 2] += f0 + f1 + f2

        # Bending moment M(psi) as a torque along (u, v): k1 psi + k3 psi^3 over psi.
        pull = ps[i, P_BENDING] + ps[i, P_BENDING + 1] * (u * u + v * v)
        force[c0] -= pull * u
        force[c0 + 1] -= pull * v
    bending_resistance(hs, coordinates, rates, force)
    for c in range(d):
        for k in range(c):
            matrix[k, c] = matrix[c, k]


@compiled
def _add_rotation(
    a: Any,
    screw: Any,
    column: Any,
    section: Any,
    columns: int,
    wx: float,
    wy: float,
    wz: float,
    qx: float,
    qy: float,
    qz: float,
    matrix: Any,
    bias: Any,
) -> None:
    """Rotational part of a head body: columns taken into the head frame, where the inertia is diagonal."""
    j0, j1, j2 = section[P_INERTIA], section[P_INERTIA + 1], section[P_INERTIA + 2]
    b0 = a[0, 0] * wx + a[1, 0] * wy + a[2, 0] * wz
    b1 = a[0, 1] * wx + a[1, 1] * wy + a[2, 1] * wz
    b2 = a[0, 2] * wx + a[1, 2] * wy + a[2, 2] * wz
    t0 = j0 * (a[0, 0] * qx + a[1, 0] * qy + a[2, 0] * qz) + (j2 - j1) * b1 * b2
    t1 = j1 * (a[0, 1] * qx + a[1, 1] * qy + a[2, 1] * qz) + (j0 - j2) * b2 * b0
    t2 = j2 * (a[0, 2] * qx + a[1, 2] * qy + a[2, 2] * qz) + (j1 - j0) * b0 * b1
    for c in range(columns):
        column[c, 0] = a[0, 0] * screw[c, 3] + a[1, 0] * screw[c, 4] + a[2, 0] * screw[c, 5]
        column[c, 1] = a[0, 1] * screw[c, 3] + a[1, 1] * screw[c, 4] + a[2, 1] * screw[c, 5]
        column[c, 2] = a[0, 2] * screw[c, 3] + a[1, 2] * screw[c, 4] + a[2, 2] * screw[c, 5]
        bias[c] += column[c, 0] * t0 + column[c, 1] * t1 + column[c, 2] * t2
        for k in range(c + 1):
            matrix[c, k] += (
                j0 * column[c, 0] * column[k, 0] + j1 * column[c, 1] * column[k, 1] + j2 * column[c, 2] * column[k, 2]
            )
