//! Arms that differ from one in some numbers of its description, made of these numbers: read once, no text in between.
//!
//! A place is the way to a number through the description's tables, as a JSON pointer (RFC 6901): `/section/0/mass`,
//! `/effect/2/parameters/tau`. Estimation makes thousands of arms of the same few places.

use super::Arm;
use crate::body::parameters::ArmParameters;
use crate::error::{Error, Result};
use serde_json::{Number, Value};

/// An arm's description, and which of its numbers are to be others.
#[derive(Clone, Debug)]
pub struct Variants {
    description: Value,
    places: Vec<String>,
}

impl Variants {
    /// Reads a description, JSON of [`ArmParameters`], and looks for the numbers at `places`. Whether an arm can have the
    /// numbers that it holds there is not asked: others will take their place.
    ///
    /// # Errors
    /// [`Error::Input`] if the text is no description, or a place holds no number.
    pub fn new(description: &str, places: Vec<String>) -> Result<Self> {
        let description: Value = serde_json::from_str(description).map_err(|e| unreadable(&e))?;
        if let Some(place) = places.iter().find(|p| !description.pointer(p).is_some_and(Value::is_number)) {
            return Err(Error::Input(format!("places: {place:?} holds no number of the description")));
        }
        read(description.clone())?;
        Ok(Self { description, places })
    }

    /// Number of places.
    pub fn size(&self) -> usize {
        self.places.len()
    }

    /// The arm with `values[k]` at place `k`.
    ///
    /// # Errors
    /// [`Error::Input`] for another number of values than of places, or one that is not finite; what [`Arm::new`] says of
    /// values that no arm has.
    pub fn arm(&self, values: &[f64]) -> Result<Arm> {
        if values.len() != self.places.len() {
            let (found, wanted) = (values.len(), self.places.len());
            return Err(Error::Input(format!("values: {found}; one a place is needed, {wanted}")));
        }
        let mut description = self.description.clone();
        for (place, &value) in self.places.iter().zip(values) {
            let not_finite = || Error::Input(format!("values: {value} at {place}; finite numbers are needed"));
            let number = Number::from_f64(value).ok_or_else(not_finite)?;
            *description.pointer_mut(place).expect("looked up when made") = Value::Number(number);
        }
        Arm::new(&read(description)?)
    }
}

fn read(description: Value) -> Result<ArmParameters> {
    serde_json::from_value(description).map_err(|e| unreadable(&e))
}

fn unreadable(error: &serde_json::Error) -> Error {
    Error::Input(format!("parameters: {error}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arm::structure::same_structure;
    use crate::arm::testing::fixed_parameters;
    use crate::body::parameters::EffectParameters;

    fn places(list: &[&str]) -> Vec<String> {
        list.iter().map(|&p| p.to_owned()).collect()
    }

    /// A description whose text is changed is the same arm.
    #[test]
    fn a_variant_is_the_arm_of_the_changed_description() {
        let mut parameters = fixed_parameters(2);
        parameters.effect.push(EffectParameters {
            kind: "payload".to_owned(),
            place: "section 2".to_owned(),
            parameters: [("mass".to_owned(), 0.1)].into(),
            force: None,
        });
        let text = serde_json::to_string(&parameters).unwrap();
        // Numbers read from text may be off in their last place: both begin with what was read.
        let mut parameters: ArmParameters = serde_json::from_str(&text).unwrap();
        let wanted = ["/section/1/mass", "/section/0/bellows/2/stiffness/1", "/gravity/2", "/effect/0/parameters/mass"];
        let variants = Variants::new(&text, places(&wanted)).unwrap();
        assert_eq!(variants.size(), 4);

        parameters.section[1].mass = 0.7;
        parameters.section[0].bellows[2].stiffness[1] = -12.5;
        parameters.gravity[2] = 0.1 + 0.2;
        parameters.effect[0].parameters.insert("mass".to_owned(), 0.3);
        let (made, direct) = (variants.arm(&[0.7, -12.5, 0.1 + 0.2, 0.3]).unwrap(), Arm::new(&parameters).unwrap());
        assert!(same_structure(&made, &direct));
        assert_eq!(format!("{made:?}"), format!("{direct:?}"));
    }

    /// Two alike effects, a mass below zero: what others will take the place of is not judged.
    #[test]
    fn numbers_to_begin_with_need_be_those_of_no_arm() {
        let mut parameters = fixed_parameters(1);
        parameters.section[0].mass = -1.0;
        let text = serde_json::to_string(&parameters).unwrap();
        let variants = Variants::new(&text, places(&["/section/0/mass"])).unwrap();
        assert!(variants.arm(&[0.5]).is_ok());
    }

    #[test]
    fn what_is_no_place_and_no_value_is_said() {
        let text = serde_json::to_string(&fixed_parameters(1)).unwrap();
        let wrong = |list: &[&str]| Variants::new(&text, places(list)).unwrap_err().to_string();
        assert!(wrong(&["/section/0/mass", "/section/4/mass"]).contains("\"/section/4/mass\" holds no number"));
        assert!(wrong(&["/name"]).contains("\"/name\" holds no number"));
        assert!(matches!(Variants::new("{", Vec::new()), Err(Error::Input(_))));
        assert!(matches!(Variants::new("{}", Vec::new()), Err(Error::Input(_))));

        let variants = Variants::new(&text, places(&["/section/0/mass"])).unwrap();
        assert!(variants.arm(&[]).unwrap_err().to_string().contains("one a place is needed, 1"));
        assert!(variants.arm(&[f64::NAN]).unwrap_err().to_string().contains("finite numbers are needed"));
        let refused = variants.arm(&[-1.0]).unwrap_err();
        assert!(matches!(&refused, Error::Parameter { key: "mass", .. }), "{refused}");
    }
}
