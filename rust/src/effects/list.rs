//! The effects of one arm: checked, resolved to its parts, over any scalar.

use super::{Definition, KINDS, Kind, KindInfo, Parameter, Place, Target};
use crate::body::Body;
use crate::body::parameters::EffectParameters;
use crate::error::{Error, Result};
use crate::real::Real;
use std::ops::Range;
use std::sync::Arc;

/// One effect of an arm.
#[derive(Clone, Debug)]
pub struct Entry<T> {
    /// Index of its kind in [`KINDS`].
    pub index: usize,
    /// How it is defined.
    pub definition: Arc<Definition>,
    /// Names of its numbers.
    pub names: Arc<[String]>,
    /// Its numbers.
    pub values: Vec<T>,
    /// What computes it.
    pub kind: Kind<T>,
    /// Its hidden states among those of all effects.
    pub hidden: Range<usize>,
}

impl<T: Real> Entry<T> {
    /// What the registry knows of its kind.
    pub fn info(&self) -> &'static KindInfo {
        &KINDS[self.index]
    }
}

/// The effects of one body, in the order of the file.
#[derive(Clone, Debug)]
pub struct Effects<T> {
    /// One after the other.
    pub list: Vec<Entry<T>>,
    /// Whether those that change the arm's parameters have done so.
    applied: bool,
}

impl<T: Real> Effects<T> {
    /// No effects.
    pub fn none() -> Self {
        Self { list: Vec::new(), applied: true }
    }

    /// Changes `body` as those effects say that do so; once, a second call changes nothing.
    pub fn apply(&mut self, body: &mut Body<T>) {
        if !self.applied {
            for entry in &self.list {
                entry.kind.change_arm(body);
            }
            self.applied = true;
        }
    }

    /// Number of hidden states of all.
    pub fn hidden_count(&self) -> usize {
        self.list.last().map_or(0, |e| e.hidden.end)
    }

    /// The hidden states of all at the start of a simulation, one effect after the other.
    pub fn start(&self) -> Vec<T> {
        let mut hidden = vec![T::zero(); self.hidden_count()];
        for entry in &self.list {
            entry.kind.start(&mut hidden[entry.hidden.clone()]);
        }
        hidden
    }

    /// The same over another scalar.
    pub fn map<U: Real>(&self, f: impl Fn(T) -> U) -> Effects<U> {
        let list = self
            .list
            .iter()
            .map(|e| {
                let values: Vec<U> = e.values.iter().map(|&v| f(v)).collect();
                Entry {
                    index: e.index,
                    definition: e.definition.clone(),
                    names: e.names.clone(),
                    kind: Kind::new(e.index, &e.definition, &values),
                    values,
                    hidden: e.hidden.clone(),
                }
            })
            .collect();
        Effects { list, applied: self.applied }
    }

    /// Sets one number of effect `index`.
    ///
    /// Those that change the arm's parameters must not have done so yet: see `Arm::unapplied`.
    ///
    /// # Errors
    /// [`Error::Input`] for an effect or a name that does not exist, or a change that would come too late.
    pub fn set(&mut self, index: usize, name: &str, value: T) -> Result<()> {
        let Some(entry) = self.list.get_mut(index) else {
            return Err(Error::Input(format!("effect {}: the arm has {}", index + 1, self.list.len())));
        };
        let Some(k) = entry.names.iter().position(|n| n == name) else {
            let names = entry.names.join(", ");
            return Err(Error::Input(format!("effect {}: no parameter {name:?}; it has {names}", index + 1)));
        };
        if self.applied && entry.info().changes_arm {
            return Err(Error::Input(format!(
                "effect {}: {} has already changed the arm; set its numbers on an arm from Arm::unapplied",
                index + 1,
                entry.info().name
            )));
        }
        entry.values[k] = value;
        entry.kind = Kind::new(entry.index, &entry.definition, &entry.values);
        Ok(())
    }
}

fn wrong(place: &str, key: &'static str, found: String, allowed: String) -> Error {
    Error::Effect { place: place.to_owned(), key, found, allowed }
}

impl Effects<f64> {
    /// The effects that `parameters` describe, for `body` with the given input names.
    ///
    /// # Errors
    /// [`Error::Effect`] names the effect, the key, what was found and what is allowed.
    pub fn new(parameters: &[EffectParameters], body: &Body<f64>, inputs: &[String]) -> Result<Self> {
        let mut list: Vec<Entry<f64>> = Vec::with_capacity(parameters.len());
        let mut hidden = 0;
        for (number, p) in parameters.iter().enumerate() {
            let mut entry = entry(number, p, body, inputs)?;
            for (other, before) in list.iter().enumerate() {
                let same = before.index == entry.index && before.definition.place == entry.definition.place;
                // Stages one after the other may be alike; side by side they would be one.
                let alike = before.values == entry.values
                    && p.force == parameters[other].force
                    && !entry.kind.shapes_pressures();
                if same && (!entry.info().several || alike) {
                    let (kind, place) = (entry.info().name, &entry.definition.place);
                    let found = format!("{kind} at {place} again, as effect {}", other + 1);
                    return Err(wrong(&format!("effect {}", number + 1), "kind", found, "once is allowed".to_owned()));
                }
            }
            entry.hidden = hidden..hidden + entry.kind.hidden();
            hidden = entry.hidden.end;
            list.push(entry);
        }
        Ok(Self { list, applied: false })
    }
}

/// One `[[effect]]` table, checked.
fn entry(number: usize, p: &EffectParameters, body: &Body<f64>, inputs: &[String]) -> Result<Entry<f64>> {
    let place_text = format!("effect {}", number + 1);
    let Some(index) = KINDS.iter().position(|k| k.name == p.kind) else {
        let names: Vec<_> = KINDS.iter().map(|k| k.name).collect();
        return Err(wrong(&place_text, "kind", p.kind.clone(), format!("one of {} is needed", names.join(", "))));
    };
    let info = &KINDS[index];
    let at = format!("{place_text} ({})", p.kind);
    let place = Place::parse(&p.place)
        .filter(|place| info.places.contains(&place.kind()))
        .ok_or_else(|| wrong(&at, "where", p.place.clone(), format!("{} is needed", places_text(info.places))))?;
    let target = Target::new(&place, body, inputs).map_err(|allowed| wrong(&at, "where", p.place.clone(), allowed))?;
    let program = match (&p.force, info.name == "formula") {
        (Some(text), true) => {
            let names: Vec<&str> = p.parameters.keys().map(String::as_str).collect();
            let program = super::kinds::formula::Program::parse(text, &names)
                .map_err(|reason| wrong(&at, "force", format!("{text:?}"), reason))?;
            Some(Arc::new(program))
        }
        (None, true) => return Err(wrong(&at, "force", "nothing".to_owned(), "a formula is needed".to_owned())),
        (Some(text), false) => {
            return Err(wrong(&at, "force", text.clone(), "only kind \"formula\" has a force".to_owned()));
        }
        (None, false) => None,
    };
    let (names, values) = if program.is_some() {
        if let Some((name, value)) = p.parameters.iter().find(|(_, v)| !v.is_finite()) {
            return Err(wrong(&at, "parameter", format!("{name} = {value}"), "a finite number is needed".to_owned()));
        }
        (p.parameters.keys().cloned().collect::<Vec<_>>(), p.parameters.values().copied().collect::<Vec<_>>())
    } else {
        (info.parameters.iter().map(|q| q.name.to_owned()).collect(), numbers(&at, info, p)?)
    };
    let definition = Arc::new(Definition { place, target, ambient_pressure: body.ambient_pressure, program });
    if let Some(reason) = (info.objection)(&values, &definition, body) {
        return Err(wrong(&at, "parameters", format!("{values:?}"), reason));
    }
    let kind = Kind::new(index, &definition, &values);
    Ok(Entry { index, definition, names: names.into(), values, kind, hidden: 0..0 })
}

/// The numbers in the order of the registry, defaults filled in.
fn numbers(at: &str, info: &KindInfo, p: &EffectParameters) -> Result<Vec<f64>> {
    for name in p.parameters.keys() {
        if !info.parameters.iter().any(|q| q.name == name) {
            let names: Vec<_> = info.parameters.iter().map(|q| q.name).collect();
            return Err(wrong(at, "parameter", name.clone(), format!("{} are allowed", names.join(", "))));
        }
    }
    let number = |q: &Parameter| {
        let Some(value) = p.parameters.get(q.name).copied().or(q.default) else {
            return Err(wrong(at, q.name, "nothing".to_owned(), format!("a number ({}) is needed", q.unit)));
        };
        if q.range.contains(&value) {
            return Ok(value);
        }
        let (low, high) = (q.range.start(), q.range.end());
        Err(wrong(at, q.name, value.to_string(), format!("{low} to {high} {} is allowed", q.unit)))
    };
    info.parameters.iter().map(number).collect()
}

fn places_text(places: &[super::PlaceKind]) -> String {
    use super::PlaceKind as P;
    let text = |p: &P| match p {
        P::All => "\"all\"",
        P::Section => "\"section 2\"",
        P::Bellows => "\"bellows 32\"",
        P::Input => "\"input p13\"",
        P::Sensors => "\"sensors\"",
        P::Heads => "\"heads\"",
    };
    places.iter().map(text).collect::<Vec<_>>().join(" or ")
}
