//! The class `Arm`: the model of one arm.

use super::arrays::{finite, pressures, shaped, small, vector, vector_or_rows, whole};
use super::errors::{input, to_python};
use super::external::Outside;
use super::signals::Signals;
use crate::arm::Arm;
use crate::arm::variants::Variants;
use crate::body::parameters::ArmParameters;
use crate::dynamics::Workspace;
use crate::dynamics::recursion::{forward_dynamics_into, inverse_dynamics_into};
use crate::dynamics::statics;
use crate::dynamics::terms::{
    actuation_matrix_into, coriolis_matrix_into, generalized_force_into, inertia_matrix_into,
};
use crate::effects;
use crate::forces::{External, ForceSet};
use crate::kinematics::chain::pass;
use crate::kinematics::coordinates::configuration;
use crate::kinematics::link::{Link, Motion};
use crate::kinematics::point::{Point, jacobian, pose, shape};
use crate::memory::reserved;
use crate::real::linear::Vec3;
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::borrow::Cow;
use std::sync::{Arc, Mutex, MutexGuard};

/// Most points of a shape.
const MOST_POINTS: usize = 1_000_000;

/// The model of one arm, from the fully expanded parameters as JSON.
#[pyclass(name = "Arm", module = "bha._core", subclass, frozen)]
pub struct PyArm {
    pub(super) arm: Arc<Arm>,
    ws: Mutex<Workspace>,
}

type Vector<'py> = Bound<'py, PyArray1<f64>>;
type Matrix<'py> = Bound<'py, PyArray2<f64>>;

impl PyArm {
    /// A panic inside the model leaves no half-written result behind: every call overwrites the work space.
    fn workspace(&self) -> MutexGuard<'_, Workspace> {
        self.ws.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
    }

    fn size(&self) -> usize {
        self.arm.coordinates()
    }

    /// What acts from outside.
    fn external(&self, f_ext: Option<&Bound<'_, PyAny>>, wrenches: Option<&Bound<'_, PyAny>>) -> PyResult<Outside> {
        Outside::read(f_ext, wrenches, self.arm.body.sections.len())
    }

    /// Appends positions and rotations of the heads at lengths `q`.
    fn heads_into(&self, q: &[f64], links: &mut [Link<f64>], positions: &mut Vec<f64>, rotations: &mut Vec<f64>) {
        pass(&self.arm.body, q, &[], Motion::Pose, links);
        if effects::poses::acts(&self.arm.effects) {
            effects::poses::heads(&self.arm.body, &self.arm.effects, links, |head| {
                positions.extend(head.position.0);
                rotations.extend(head.rotation.0.as_flattened());
            });
        } else {
            positions.extend(links.iter().flat_map(|l| l.position.0));
            rotations.extend(links.iter().flat_map(|l| l.rotation.0).flatten());
        }
    }

    /// Does `work` for each row of lengths `q`, with the interpreter released; Ctrl-C ends it.
    fn each(&self, py: Python<'_>, q: &[f64], mut work: impl FnMut(&[f64]) + Send) -> PyResult<()> {
        let mut signals = Signals::new();
        py.detach(|| {
            for (k, q) in q.chunks_exact(self.size()).enumerate() {
                work(q);
                if k % 16 == 0 && signals.stop() {
                    break;
                }
            }
        });
        signals.result()
    }

    fn force(&self, set: ForceSet, (q, qd): (&[f64], &[f64]), p: &[f64], f_ext: Option<External<'_, f64>>) -> Vec<f64> {
        let mut out = vec![0.0; self.size()];
        generalized_force_into(&self.arm, set, (q, qd), p, f_ext, &mut self.workspace(), &mut out);
        out
    }

    /// The pressures that act at rest under the logged ones.
    fn acting<'a>(&self, p: &'a [f64]) -> Cow<'a, [f64]> {
        if self.arm.effects.list.is_empty() {
            return Cow::Borrowed(p);
        }
        let mut out = p.to_vec();
        effects::pressures::at_rest(&self.arm.effects, &mut out);
        Cow::Owned(out)
    }

    fn point(
        &self,
        section: &Bound<'_, PyAny>,
        fraction: f64,
        offset: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Point<f64>> {
        let (py, count) = (section.py(), self.arm.body.sections.len());
        let section = whole(section, "section", (1, count))?;
        if !(0.0..=1.0).contains(&fraction) {
            return Err(input(py, format!("fraction: {fraction} is outside 0 to 1")));
        }
        let offset = match offset.map(|o| vector(o, "offset", 3)).transpose()? {
            Some(o) => Vec3([o[0], o[1], o[2]]),
            None => Vec3::zero(),
        };
        Ok(Point { section: section - 1, fraction, offset })
    }
}

impl PyArm {
    fn of(arm: Arm) -> Self {
        Self { ws: Mutex::new(Workspace::new(&arm)), arm: Arc::new(arm) }
    }
}

#[pymethods]
impl PyArm {
    #[new]
    #[pyo3(signature = (parameters_json))]
    fn new(py: Python<'_>, parameters_json: &str) -> PyResult<Self> {
        let parameters: ArmParameters =
            serde_json::from_str(parameters_json).map_err(|e| input(py, format!("parameters: {e}")))?;
        let arm = Arm::new(&parameters).map_err(|e| to_python(py, &e))?;
        Ok(Self::of(arm))
    }

    /// Positions (n, 3) and orientations (n, 3, 3) of the heads in the world, effects on poses
    /// (torsion) included; for lengths (m, 3n) of many states (m, n, 3) and (m, n, 3, 3). Paper (14).
    fn forward_kinematics<'py>(&self, q: &Bound<'py, PyAny>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let (py, n) = (q.py(), self.arm.body.sections.len());
        let (q, rows) = vector_or_rows(q, "q", self.size())?;
        let Some(m) = rows else {
            let (mut positions, mut rotations) = (Vec::with_capacity(3 * n), Vec::with_capacity(9 * n));
            self.heads_into(&q, &mut self.workspace().links, &mut positions, &mut rotations);
            let (positions, rotations) = (finite(py, "positions", positions)?, finite(py, "rotations", rotations)?);
            return Ok((shaped(py, positions, [n, 3])?.into_any(), shaped(py, rotations, [n, 3, 3])?.into_any()));
        };
        let room = |what, size| reserved(what, &[m, n, size]).map_err(|e| to_python(py, &e));
        let (mut positions, mut rotations) = (room("positions", 3)?, room("rotations", 9)?);
        let mut links = vec![Link::base(); n];
        self.each(py, &q, |q| self.heads_into(q, &mut links, &mut positions, &mut rotations))?;
        let (positions, rotations) = (finite(py, "positions", positions)?, finite(py, "rotations", rotations)?);
        Ok((shaped(py, positions, [m, n, 3])?.into_any(), shaped(py, rotations, [m, n, 3, 3])?.into_any()))
    }

    /// Orientation (3, 3) and position (3,) of a point of the arm in the world.
    #[pyo3(signature = (q, section, fraction = 1.0, offset = None))]
    fn point_pose<'py>(
        &self,
        q: &Bound<'py, PyAny>,
        section: &Bound<'py, PyAny>,
        fraction: f64,
        offset: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<(Matrix<'py>, Vector<'py>)> {
        let py = q.py();
        let point = self.point(section, fraction, offset)?;
        let q = vector(q, "q", self.size())?;
        let mut ws = self.workspace();
        pass(&self.arm.body, &q, &[], Motion::Pose, &mut ws.links);
        let (rotation, position) = pose(&self.arm.body, &ws.links, &point);
        let (rotation, position) = (finite(py, "rotation", rotation.0.concat())?, finite(py, "position", position.0)?);
        Ok((shaped(py, rotation, [3, 3])?, small(py, &position)))
    }

    /// Jacobian (6, 3n) of a point by the lengths: velocity, then angular velocity, in the world.
    #[pyo3(signature = (q, section, fraction = 1.0, offset = None))]
    fn jacobian<'py>(
        &self,
        q: &Bound<'py, PyAny>,
        section: &Bound<'py, PyAny>,
        fraction: f64,
        offset: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Matrix<'py>> {
        let (py, m) = (q.py(), self.size());
        let point = self.point(section, fraction, offset)?;
        let q = vector(q, "q", m)?;
        let mut ws = self.workspace();
        pass(&self.arm.body, &q, &[], Motion::Pose, &mut ws.links);
        let mut columns = vec![[Vec3::zero(); 2]; m];
        jacobian(&self.arm.body, &ws.links, &point, &mut columns);
        let element = |row: usize| columns.iter().map(move |c| c[row / 3].0[row % 3]);
        shaped(py, finite(py, "jacobian", (0..6).flat_map(element).collect::<Vec<_>>())?, [6, m])
    }

    /// Points (k, 3) along the backbone from the base on, `points_per_section` + 1 on each arc and the ends of rigid pieces;
    /// for lengths (m, 3n) of many states (m, k, 3).
    #[pyo3(signature = (q, points_per_section = None))]
    fn shape<'py>(
        &self,
        q: &Bound<'py, PyAny>,
        points_per_section: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (py, n) = (q.py(), self.arm.body.sections.len());
        let limits = (1, MOST_POINTS / n.max(1));
        let points_per_section = points_per_section.map_or(Ok(20), |k| whole(k, "points_per_section", limits))?;
        let (q, rows) = vector_or_rows(q, "q", self.size())?;
        let k = 1 + n * (points_per_section + 2);
        let mut out = reserved("points", &[rows.unwrap_or(1), k, 3]).map_err(|e| to_python(py, &e))?;
        let (mut links, mut points) = (vec![Link::base(); n], Vec::with_capacity(k));
        self.each(py, &q, |q| {
            shape(&self.arm.body, q, points_per_section, &mut links, &mut points);
            out.extend(points.iter().flat_map(|p| p.0));
        })?;
        let out = finite(py, "points", out)?;
        match rows {
            None => Ok(shaped(py, out, [k, 3])?.into_any()),
            Some(m) => Ok(shaped(py, out, [m, k, 3])?.into_any()),
        }
    }

    /// The paper's configuration (n, 3) of (7): phi, kappa, l of each section; phi = 0 where a section is straight.
    fn configuration<'py>(&self, q: &Bound<'py, PyAny>) -> PyResult<Matrix<'py>> {
        let (py, n) = (q.py(), self.arm.body.sections.len());
        let q = vector(q, "q", self.size())?;
        let values = q.chunks_exact(3).zip(&self.arm.body.sections);
        let out = values.flat_map(|(c, s)| configuration([c[0], c[1], c[2]], s.bellows_radius));
        shaped(py, finite(py, "configuration", out.collect::<Vec<_>>())?, [n, 3])
    }

    /// The terms of M q'' + C q' + N = tau. Paper (48)-(53).
    #[pyo3(signature = (q, qd, p, f_ext = None, wrenches = None))]
    fn dynamics_terms(
        &self,
        q: &Bound<'_, PyAny>,
        qd: &Bound<'_, PyAny>,
        p: &Bound<'_, PyAny>,
        f_ext: Option<&Bound<'_, PyAny>>,
        wrenches: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<DynamicsTerms> {
        let (py, m) = (q.py(), self.size());
        let (q, qd) = (vector(q, "q", m)?, vector(qd, "qd", m)?);
        let p = pressures(p, "p", self.arm.body.inputs)?;
        let f = self.external(f_ext, wrenches)?;
        let (q, qd, p) = (&q, &qd, &p);
        let (mut inertia, mut coriolis) = (vec![0.0; m * m], vec![0.0; m * m]);
        inertia_matrix_into(&self.arm, q, &mut self.workspace(), &mut inertia);
        coriolis_matrix_into(&self.arm, q, qd, &mut self.workspace(), &mut coriolis);
        let actuation = ForceSet { actuation: true, ..ForceSet::NONE };
        let passive = self.force(ForceSet::PASSIVE, (q, qd), &[], f.get());
        let tau = self.force(actuation, (q, qd), &self.acting(p), None);
        Ok(DynamicsTerms {
            inertia_matrix: shaped(py, finite(py, "inertia_matrix", inertia)?, [m, m])?.unbind(),
            coriolis_matrix: shaped(py, finite(py, "coriolis_matrix", coriolis)?, [m, m])?.unbind(),
            bias_force: small(py, &finite(py, "bias_force", negative(&passive))?).unbind(),
            actuation_force: small(py, &finite(py, "actuation_force", tau)?).unbind(),
        })
    }

    /// N's parts by name (spring, damping, axial, bending, gravity, external, effects), each (3n,); they add up to `bias_force`. Paper (52).
    #[pyo3(signature = (q, qd, f_ext = None, wrenches = None))]
    fn bias_force_parts<'py>(
        &self,
        q: &Bound<'py, PyAny>,
        qd: &Bound<'py, PyAny>,
        f_ext: Option<&Bound<'py, PyAny>>,
        wrenches: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let (py, m) = (q.py(), self.size());
        let (q, qd) = (vector(q, "q", m)?, vector(qd, "qd", m)?);
        let f = self.external(f_ext, wrenches)?;
        let none = ForceSet::NONE;
        let out = PyDict::new(py);
        for (name, set) in [
            ("spring", ForceSet { spring: true, ..none }),
            ("damping", ForceSet { damping: true, ..none }),
            ("axial", ForceSet { axial: true, ..none }),
            ("bending", ForceSet { bending: true, ..none }),
            ("gravity", ForceSet { gravity: true, ..none }),
            ("external", ForceSet { external: true, ..none }),
            ("effects", ForceSet { effects: true, ..none }),
        ] {
            let force = self.force(set, (&q, &qd), &[], f.get());
            let force = force.iter().map(|f| 0.0 - f).collect::<Vec<_>>();
            out.set_item(name, small(py, &finite(py, name, force)?))?;
        }
        Ok(out)
    }

    /// M (3n, 3n). Paper (49).
    fn inertia_matrix<'py>(&self, q: &Bound<'py, PyAny>) -> PyResult<Matrix<'py>> {
        let (py, m) = (q.py(), self.size());
        let q = vector(q, "q", m)?;
        let mut out = vec![0.0; m * m];
        inertia_matrix_into(&self.arm, &q, &mut self.workspace(), &mut out);
        shaped(py, finite(py, "inertia_matrix", out)?, [m, m])
    }

    /// C (3n, 3n), in the form for which dM/dt - 2C is skew-symmetric. Paper (50).
    fn coriolis_matrix<'py>(&self, q: &Bound<'py, PyAny>, qd: &Bound<'py, PyAny>) -> PyResult<Matrix<'py>> {
        let (py, m) = (q.py(), self.size());
        let (q, qd) = (vector(q, "q", m)?, vector(qd, "qd", m)?);
        let mut out = vec![0.0; m * m];
        coriolis_matrix_into(&self.arm, &q, &qd, &mut self.workspace(), &mut out);
        shaped(py, finite(py, "coriolis_matrix", out)?, [m, m])
    }

    /// N (3n,): springs, damping, bending, gravity, external forces. Paper (52).
    #[pyo3(signature = (q, qd, f_ext = None, wrenches = None))]
    fn bias_force<'py>(
        &self,
        q: &Bound<'py, PyAny>,
        qd: &Bound<'py, PyAny>,
        f_ext: Option<&Bound<'py, PyAny>>,
        wrenches: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Vector<'py>> {
        let (py, m) = (q.py(), self.size());
        let (q, qd) = (vector(q, "q", m)?, vector(qd, "qd", m)?);
        let f = self.external(f_ext, wrenches)?;
        let passive = self.force(ForceSet::PASSIVE, (&q, &qd), &[], f.get());
        Ok(small(py, &finite(py, "bias_force", negative(&passive))?))
    }

    /// tau (3n,). Paper (53).
    fn actuation_force<'py>(&self, q: &Bound<'py, PyAny>, p: &Bound<'py, PyAny>) -> PyResult<Vector<'py>> {
        let py = q.py();
        let (q, p) = (vector(q, "q", self.size())?, pressures(p, "p", self.arm.body.inputs)?);
        let set = ForceSet { actuation: true, ..ForceSet::NONE };
        Ok(small(py, &finite(py, "actuation_force", self.force(set, (&q, &[]), &self.acting(&p), None))?))
    }

    /// d tau/dp (3n, inputs): tau = A(q) (p - p_amb).
    fn actuation_matrix<'py>(&self, q: &Bound<'py, PyAny>) -> PyResult<Matrix<'py>> {
        let (py, m, inputs) = (q.py(), self.size(), self.arm.body.inputs);
        let q = vector(q, "q", m)?;
        let mut out = vec![0.0; m * inputs];
        actuation_matrix_into(&self.arm, &q, &mut self.workspace(), &mut out);
        // The acting pressures are an affine function of the logged ones, one by one.
        let (zero, one) = (vec![0.0; inputs], vec![1.0; inputs]);
        let (zero, one) = (self.acting(&zero), self.acting(&one));
        for row in out.chunks_exact_mut(inputs.max(1)) {
            for (a, (one, zero)) in row.iter_mut().zip(one.iter().zip(zero.iter())) {
                *a *= one - zero;
            }
        }
        shaped(py, finite(py, "actuation_matrix", out)?, [m, inputs])
    }

    /// q'' (3n,), in O(n). Paper (48).
    ///
    /// Of an arm with effects the stateless parts act; hidden states (creep, hysteresis, friction, lag, delay, dead band) are
    /// at rest: they exert no force and the pressures have settled.
    #[pyo3(signature = (q, qd, p, f_ext = None, wrenches = None))]
    fn forward_dynamics<'py>(
        &self,
        q: &Bound<'py, PyAny>,
        qd: &Bound<'py, PyAny>,
        p: &Bound<'py, PyAny>,
        f_ext: Option<&Bound<'py, PyAny>>,
        wrenches: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Vector<'py>> {
        let (py, m) = (q.py(), self.size());
        let (q, qd) = (vector(q, "q", m)?, vector(qd, "qd", m)?);
        let p = pressures(p, "p", self.arm.body.inputs)?;
        let f = self.external(f_ext, wrenches)?;
        let mut qdd = vec![0.0; m];
        forward_dynamics_into(&self.arm, &q, &qd, &self.acting(&p), f.get(), &mut self.workspace(), &mut qdd);
        Ok(small(py, &finite(py, "acceleration", qdd)?))
    }

    /// The actuation force tau (3n,) needed for an acceleration: M q'' + C q' + N. Paper (48).
    #[pyo3(signature = (q, qd, qdd, f_ext = None, wrenches = None))]
    fn inverse_dynamics<'py>(
        &self,
        q: &Bound<'py, PyAny>,
        qd: &Bound<'py, PyAny>,
        qdd: &Bound<'py, PyAny>,
        f_ext: Option<&Bound<'py, PyAny>>,
        wrenches: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Vector<'py>> {
        let (py, m) = (q.py(), self.size());
        let (q, qd, qdd) = (vector(q, "q", m)?, vector(qd, "qd", m)?, vector(qdd, "qdd", m)?);
        let f = self.external(f_ext, wrenches)?;
        let mut out = vec![0.0; m];
        let (q, qd, qdd) = (&q, &qd, &qdd);
        inverse_dynamics_into(&self.arm, q, qd, qdd, f.get(), &mut self.workspace(), &mut out);
        Ok(small(py, &finite(py, "actuation_force", out)?))
    }

    /// Energies at a state, J. Paper (16), (33), (36)-(38).
    fn energy(&self, q: &Bound<'_, PyAny>, qd: &Bound<'_, PyAny>) -> PyResult<Energy> {
        let (py, m) = (q.py(), self.size());
        let (q, qd) = (vector(q, "q", m)?, vector(qd, "qd", m)?);
        let e = crate::dynamics::energy::energy(&self.arm, &q, &qd, &mut self.workspace());
        finite(py, "energy", [e.kinetic(), e.potential()])?;
        Ok(Energy(e))
    }

    /// Lengths (3n,) at rest: static coupled (62), N(q, 0) = tau(q, p); with `coupled=False` spring forces against pressure only.
    #[pyo3(signature = (p, f_ext = None, *, wrenches = None, coupled = true, start = None))]
    fn static_lengths<'py>(
        &self,
        p: &Bound<'py, PyAny>,
        f_ext: Option<&Bound<'py, PyAny>>,
        wrenches: Option<&Bound<'py, PyAny>>,
        coupled: bool,
        start: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Vector<'py>> {
        let py = p.py();
        let p = pressures(p, "p", self.arm.body.inputs)?;
        let f = self.external(f_ext, wrenches)?;
        let start = start.map(|s| vector(s, "start", self.size())).transpose()?;
        let p = self.acting(&p);
        let mut signals = Signals::new();
        let result = py.detach(|| {
            if coupled {
                statics::static_lengths_until(&self.arm, &p, f.get(), start.as_deref(), &mut || signals.stop())
            } else {
                statics::static_decoupled_lengths(&self.arm, &p)
            }
        });
        signals.result()?;
        let q = result.map_err(|e| to_python(py, &e))?;
        Ok(small(py, &finite(py, "lengths at rest", q)?))
    }
}

fn negative(values: &[f64]) -> Vec<f64> {
    values.iter().map(|f| -f).collect()
}

/// M, C, N and tau at one state.
#[pyclass(module = "bha._core", frozen)]
pub struct DynamicsTerms {
    /// M (3n, 3n).
    #[pyo3(get)]
    inertia_matrix: Py<PyArray2<f64>>,
    /// C (3n, 3n).
    #[pyo3(get)]
    coriolis_matrix: Py<PyArray2<f64>>,
    /// N (3n,).
    #[pyo3(get)]
    bias_force: Py<PyArray1<f64>>,
    /// tau (3n,).
    #[pyo3(get)]
    actuation_force: Py<PyArray1<f64>>,
}

/// Energies, J.
#[pyclass(module = "bha._core", frozen)]
pub struct Energy(crate::dynamics::energy::Energy);

#[pymethods]
impl Energy {
    /// Translational kinetic energy.
    #[getter]
    fn translational(&self) -> f64 {
        self.0.translational
    }
    /// Rotational kinetic energy.
    #[getter]
    fn rotational(&self) -> f64 {
        self.0.rotational
    }
    /// Potential of the weight, zero at the base's origin.
    #[getter]
    fn gravity(&self) -> f64 {
        self.0.gravity
    }
    /// Energy of bending.
    #[getter]
    fn bending(&self) -> f64 {
        self.0.bending
    }
    /// Energy in the bellows' springs.
    #[getter]
    fn spring(&self) -> f64 {
        self.0.spring
    }
    /// Energy in what holds the sections' mean lengths beside their bellows.
    #[getter]
    fn axial(&self) -> f64 {
        self.0.axial
    }
    /// Kinetic energy.
    #[getter]
    fn kinetic(&self) -> f64 {
        self.0.kinetic()
    }
    /// Potential energy, springs included.
    #[getter]
    fn potential(&self) -> f64 {
        self.0.potential()
    }
    /// Kinetic and potential energy.
    #[getter]
    fn total(&self) -> f64 {
        self.0.total()
    }
    fn __repr__(&self) -> String {
        let e = &self.0;
        format!(
            "Energy(translational={:.6e}, rotational={:.6e}, gravity={:.6e}, bending={:.6e}, spring={:.6e}, axial={:.6e})",
            e.translational, e.rotational, e.gravity, e.bending, e.spring, e.axial
        )
    }
}

/// Arms that differ from one in the numbers at some places of its description.
#[pyclass(name = "Variants", module = "bha._core", frozen)]
pub struct PyVariants {
    variants: Variants,
}

#[pymethods]
impl PyVariants {
    #[new]
    fn new(py: Python<'_>, parameters_json: &str, places: Vec<String>) -> PyResult<Self> {
        Ok(Self { variants: Variants::new(parameters_json, places).map_err(|e| to_python(py, &e))? })
    }

    /// The arm with some values (k,), one a place.
    fn arm(&self, values: &Bound<'_, PyAny>) -> PyResult<PyArm> {
        let py = values.py();
        let values = vector(values, "values", self.variants.size())?;
        self.variants.arm(&values).map(PyArm::of).map_err(|e| to_python(py, &e))
    }
}
