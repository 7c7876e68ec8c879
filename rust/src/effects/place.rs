//! Places: how a file names them and which parts of an arm they mean.

use super::PlaceKind;
use crate::body::Body;
use std::fmt;
use std::ops::Range;

/// A place as the file names it; numbers count from 1.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum Place {
    /// `all`
    All,
    /// `section 2`
    Section(usize),
    /// `bellows 32`: section 3, bellows 2.
    Bellows(usize, usize),
    /// `input p13`
    Input(String),
    /// `sensors`
    Sensors,
    /// `heads`
    Heads,
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::All => write!(f, "all"),
            Self::Section(i) => write!(f, "section {i}"),
            Self::Bellows(i, k) if *i > 9 || *k > 9 => write!(f, "bellows {i}_{k}"),
            Self::Bellows(i, k) => write!(f, "bellows {i}{k}"),
            Self::Input(name) => write!(f, "input {name}"),
            Self::Sensors => write!(f, "sensors"),
            Self::Heads => write!(f, "heads"),
        }
    }
}

impl Place {
    /// The place that a text names, if it names one.
    pub fn parse(text: &str) -> Option<Self> {
        match text.split_once(' ') {
            None if text == "all" => Some(Self::All),
            None if text == "sensors" => Some(Self::Sensors),
            None if text == "heads" => Some(Self::Heads),
            Some(("section", i)) => number(i).map(Self::Section),
            Some(("input", name)) if !name.is_empty() => Some(Self::Input(name.to_owned())),
            Some(("bellows", pair)) => {
                if let Some((i, k)) = pair.split_once('_') {
                    return Some(Self::Bellows(number(i)?, number(k)?));
                }
                if pair.len() != 2 || !pair.is_ascii() {
                    return None;
                }
                Some(Self::Bellows(number(&pair[..1])?, number(&pair[1..])?))
            }
            _ => None,
        }
    }

    /// Which sort of place it is.
    pub fn kind(&self) -> PlaceKind {
        match self {
            Self::All => PlaceKind::All,
            Self::Section(_) => PlaceKind::Section,
            Self::Bellows(..) => PlaceKind::Bellows,
            Self::Input(_) => PlaceKind::Input,
            Self::Sensors => PlaceKind::Sensors,
            Self::Heads => PlaceKind::Heads,
        }
    }
}

fn number(text: &str) -> Option<usize> {
    let plain = !text.starts_with('0') && text.bytes().all(|c| c.is_ascii_digit());
    if plain { text.parse().ok() } else { None }
}

/// The parts of an arm that a place means, indices from 0.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Target {
    /// Sections.
    pub sections: Range<usize>,
    /// Bellows, counted through all sections.
    pub bellows: Range<usize>,
    /// Pressure inputs.
    pub inputs: Range<usize>,
    /// Coordinate lengths, three a section.
    pub lengths: Range<usize>,
}

/// The inputs of a section's bellows; none if they are not neighbours in the arm's order of inputs.
fn section_inputs<T>(body: &Body<T>, section: usize) -> Range<usize> {
    let fed = || body.sections[section].bellows.iter().map(|b| b.input);
    match (fed().min(), fed().max()) {
        (Some(first), Some(last)) if (first..=last).all(|j| fed().any(|k| k == j)) => first..last + 1,
        _ => 0..0,
    }
}

impl Target {
    /// What `place` means on `body` with the given input names, or what is wrong with it.
    pub fn new<T>(place: &Place, body: &Body<T>, inputs: &[String]) -> Result<Self, String> {
        let sections = body.sections.len();
        let starts: Vec<usize> = body
            .sections
            .iter()
            .scan(0, |sum, s| Some(std::mem::replace(sum, *sum + s.bellows.len())))
            .chain([body.sections.iter().map(|s| s.bellows.len()).sum()])
            .collect();
        let section = |i: usize| {
            if (1..=sections).contains(&i) {
                return Ok(i - 1);
            }
            Err(format!("there is no section {i}; sections 1 to {sections} exist"))
        };
        let all = Self {
            sections: 0..sections,
            bellows: 0..starts[sections],
            inputs: 0..inputs.len(),
            lengths: 0..3 * sections,
        };
        match place {
            Place::All | Place::Sensors | Place::Heads => Ok(all),
            Place::Section(i) => {
                let i = section(*i)?;
                Ok(Self {
                    sections: i..i + 1,
                    bellows: starts[i]..starts[i + 1],
                    inputs: section_inputs(body, i),
                    lengths: 3 * i..3 * i + 3,
                })
            }
            Place::Bellows(i, k) => {
                let i = section(*i)?;
                let count = body.sections[i].bellows.len();
                if *k == 0 || *k > count.max(3) {
                    return Err(format!("section {} has no bellows {k}; bellows 1 to {count} exist", i + 1));
                }
                // A section has three length sensors, whatever the number of its bellows.
                let one = |start: usize, end: usize| {
                    let at = start + k - 1;
                    if at < end { at..at + 1 } else { 0..0 }
                };
                Ok(Self {
                    sections: i..i + 1,
                    bellows: one(starts[i], starts[i + 1]),
                    inputs: 0..0,
                    lengths: one(3 * i, 3 * i + 3),
                })
            }
            Place::Input(name) => {
                let Some(j) = inputs.iter().position(|n| n == name) else {
                    return Err(format!("there is no input {name}; the arm has {}", inputs.join(", ")));
                };
                Ok(Self { sections: 0..0, bellows: 0..0, inputs: j..j + 1, lengths: 0..0 })
            }
        }
    }
}
