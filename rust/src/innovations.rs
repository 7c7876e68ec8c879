//! Kalman's filter of what a simulation leaves: residuals to innovations.
//!
//! Knows nothing of arms. The residual of row k is r_k = H d_k + white noise, its channels independent, and the state goes
//! on as d_{k+1} = K_k (F_k d_k + noise of covariance Q_k) + noise that keeps its size, K_k diagonal. The channels of a row are
//! taken one after the other (Kalman 1960; sequential form: Anderson and Moore 1979, section 6.4): no factorization, and a
//! channel that was not read is left out. The filter is linear in the residuals: many columns go through the same gains.
//! These are constant as soon as they change no more and rows stay alike; then only the columns are worked on.

/// Relative change of gains below which they are constant.
const CONSTANT: f64 = 1e-8;

/// The system and the rows; all matrices row by row.
pub struct Rows<'a> {
    /// States.
    pub states: usize,
    /// Channels.
    pub channels: usize,
    /// Transitions F (kinds, states, states).
    pub transitions: &'a [f64],
    /// Covariances Q of what is added over them (kinds, states, states).
    pub added: &'a [f64],
    /// Of which kind each row is: what it shows, and which transition leads from it to the next.
    pub kinds: &'a [usize],
    /// Factor K on each state from each row to the next (rows, states); what it takes of a state's size is renewed.
    pub kept: &'a [f64],
    /// Variance that a state keeps under such factors (states).
    pub sizes: &'a [f64],
    /// H (kinds, channels, states).
    pub shown: &'a [f64],
    /// Variance of the white noise of each channel.
    pub white: &'a [f64],
    /// Which channels were read (rows, channels).
    pub read: &'a [bool],
}

/// Gains of one row.
struct Gains {
    /// (channels, states); and one over the standard deviation of each innovation.
    gains: Vec<f64>,
    inverse: Vec<f64>,
    determinant: f64,
}

impl Rows<'_> {
    /// Innovations over their standard deviations, in place of the residuals (rows, channels, columns), and the logarithm
    /// of the determinant of the residuals' covariance; None if that covariance is not positive.
    ///
    /// `covariance` is that of the state before the first row.
    pub fn whiten(&self, covariance: &[f64], columns: usize, values: &mut [f64]) -> Option<f64> {
        let (s, c) = (self.states, self.channels);
        let mut p = covariance.to_vec();
        let mut scratch = vec![0.0; s * s];
        let mut now = Gains { gains: vec![0.0; c * s], inverse: vec![0.0; c], determinant: 0.0 };
        let mut before = vec![0.0; c * s];
        let (mut state, mut next) = (vec![0.0; s * columns], vec![0.0; s * columns]);
        let (mut constant, mut total) = (false, 0.0);
        for (k, row) in values.chunks_exact_mut((c * columns).max(1)).enumerate() {
            constant = constant && k > 0 && self.alike(k);
            if !constant {
                std::mem::swap(&mut before, &mut now.gains);
                if !self.gain(k, &mut p, &mut now) {
                    return None;
                }
                self.forward(k, &mut p, &mut scratch);
                constant = k > 0 && self.alike(k) && close(&before, &now.gains);
            }
            total += now.determinant;
            self.update(k, &now, columns, row, &mut state);
            self.step(k, columns, &mut state, &mut next);
        }
        Some(total)
    }

    fn read(&self, k: usize) -> &[bool] {
        &self.read[k * self.channels..(k + 1) * self.channels]
    }

    fn shown(&self, k: usize, channel: usize) -> &[f64] {
        let first = (self.kinds[k] * self.channels + channel) * self.states;
        &self.shown[first..first + self.states]
    }

    fn kept(&self, k: usize) -> &[f64] {
        &self.kept[k * self.states..(k + 1) * self.states]
    }

    /// Whether row k is read and followed as the one before it.
    fn alike(&self, k: usize) -> bool {
        self.kinds[k] == self.kinds[k - 1] && self.read(k) == self.read(k - 1) && self.kept(k) == self.kept(k - 1)
    }

    /// Takes the channels of row k into the covariance.
    fn gain(&self, k: usize, p: &mut [f64], out: &mut Gains) -> bool {
        let s = self.states;
        out.determinant = 0.0;
        let mut seen = vec![0.0; s];
        for (channel, read) in self.read(k).iter().enumerate() {
            let gain = &mut out.gains[channel * s..(channel + 1) * s];
            gain.fill(0.0);
            out.inverse[channel] = 0.0;
            if !read {
                continue;
            }
            let h = self.shown(k, channel);
            for (value, line) in seen.iter_mut().zip(p.chunks_exact(s.max(1))) {
                *value = dot(line, h);
            }
            let size = dot(&seen, h) + self.white[channel];
            if !(size > 0.0 && size.is_finite()) {
                return false;
            }
            out.determinant += size.ln();
            out.inverse[channel] = 1.0 / size.sqrt();
            for (g, value) in gain.iter_mut().zip(&seen) {
                *g = value / size;
            }
            for (line, g) in p.chunks_exact_mut(s.max(1)).zip(gain.iter()) {
                add(line, -g, &seen);
            }
        }
        true
    }

    /// The covariance of the state at the row after k.
    fn forward(&self, k: usize, p: &mut [f64], scratch: &mut [f64]) {
        let s = self.states;
        let f = self.transition(k);
        let kept = self.kept(k);
        scratch.fill(0.0);
        for i in 0..s {
            for j in 0..s {
                let factor = f[i * s + j];
                if factor != 0.0 {
                    add(&mut scratch[i * s..(i + 1) * s], factor, &p[j * s..(j + 1) * s]);
                }
            }
        }
        let added = &self.added[self.kinds[k] * s * s..(self.kinds[k] + 1) * s * s];
        for i in 0..s {
            for j in 0..=i {
                let value = dot(&scratch[i * s..(i + 1) * s], &f[j * s..(j + 1) * s]) + added[i * s + j];
                let value = kept[i] * kept[j] * value;
                p[i * s + j] = value;
                p[j * s + i] = value;
            }
            p[i * s + i] += (1.0 - kept[i] * kept[i]) * self.sizes[i];
        }
    }

    fn transition(&self, k: usize) -> &[f64] {
        let count = self.states * self.states;
        &self.transitions[self.kinds[k] * count..(self.kinds[k] + 1) * count]
    }

    /// Innovations of row k in place of its residuals, and the state with them taken in.
    fn update(&self, k: usize, gains: &Gains, columns: usize, row: &mut [f64], state: &mut [f64]) {
        let s = self.states;
        for (channel, (values, read)) in row.chunks_exact_mut(columns.max(1)).zip(self.read(k)).enumerate() {
            if !read {
                values.fill(0.0);
                continue;
            }
            let h = self.shown(k, channel);
            for (line, h) in state.chunks_exact(columns.max(1)).zip(h) {
                if *h != 0.0 {
                    add(values, -h, line);
                }
            }
            let gain = &gains.gains[channel * s..(channel + 1) * s];
            for (line, g) in state.chunks_exact_mut(columns.max(1)).zip(gain) {
                add(line, *g, values);
            }
            values.iter_mut().for_each(|v| *v *= gains.inverse[channel]);
        }
    }

    /// The state at the row after k.
    fn step(&self, k: usize, columns: usize, state: &mut Vec<f64>, next: &mut Vec<f64>) {
        let s = self.states;
        let f = self.transition(k);
        next.fill(0.0);
        for (i, (line, kept)) in next.chunks_exact_mut(columns.max(1)).zip(self.kept(k)).enumerate() {
            for j in 0..s {
                let factor = kept * f[i * s + j];
                if factor != 0.0 {
                    add(line, factor, &state[j * columns..(j + 1) * columns]);
                }
            }
        }
        std::mem::swap(state, next);
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// `to` += `factor` * `values`.
fn add(to: &mut [f64], factor: f64, values: &[f64]) {
    for (t, v) in to.iter_mut().zip(values) {
        *t += factor * v;
    }
}

/// Whether no gain differs by more than a small part of the greatest.
fn close(a: &[f64], b: &[f64]) -> bool {
    let greatest = b.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    a.iter().zip(b).all(|(a, b)| (a - b).abs() <= CONSTANT * greatest)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A scalar first-order process under white noise: gains by hand.
    #[test]
    fn a_scalar_is_filtered_as_by_hand() {
        let rows = Rows {
            states: 1,
            channels: 1,
            transitions: &[0.5],
            added: &[0.75],
            kinds: &[0, 0, 0],
            kept: &[1.0; 3],
            sizes: &[0.0],
            shown: &[1.0],
            white: &[1.0],
            read: &[true, false, true],
        };
        let mut values = vec![1.0, 7.0, 1.0];
        let total = rows.whiten(&[1.0], 1, &mut values).unwrap();
        // Row 0: size 2, gain 1/2, state 1/2. Two steps on: state 1/8, variance (1/2 / 4 + 3/4) / 4 + 3/4 = 31/32.
        let size: f64 = 31.0 / 32.0 + 1.0;
        assert!((values[0] - 0.5_f64.sqrt()).abs() < 1e-14);
        assert!(values[1] == 0.0);
        assert!((values[2] - 0.875 / size.sqrt()).abs() < 1e-14);
        assert!((total - (2.0_f64.ln() + size.ln())).abs() < 1e-14);
    }

    #[test]
    fn what_is_kept_in_part_keeps_its_size() {
        let rows = Rows {
            states: 1,
            channels: 1,
            transitions: &[1.0],
            added: &[0.0],
            kinds: &[0, 0],
            kept: &[0.5, 0.5],
            sizes: &[1.0],
            shown: &[1.0],
            white: &[1.0],
            read: &[false, true],
        };
        let mut values = vec![0.0, 1.0];
        assert!((rows.whiten(&[1.0], 1, &mut values).unwrap() - 2.0_f64.ln()).abs() < 1e-14);
    }
}
