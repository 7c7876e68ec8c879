//! How a table of text is laid out: what parts its fields, what marks decimals, where headings and numbers begin.

/// The layout of a table. The default is that of a plain CSV file; only there must all lines have the same number of
/// fields. Programs that write other layouts end lines with separators, or leave out the last, empty fields.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Layout {
    /// Between fields: `,`, `;` or a tab.
    pub separator: u8,
    /// Whether numbers have a decimal comma; a point is no number then, for it might part thousands.
    pub decimal_comma: bool,
    /// Line of the headings, from 1.
    pub headings_line: u64,
    /// Line from which on there are numbers and empty lines, from 1: the one after the last line of text.
    pub numbers_line: u64,
}

impl Default for Layout {
    fn default() -> Self {
        Self { separator: b',', decimal_comma: false, headings_line: 1, numbers_line: 2 }
    }
}

impl Layout {
    /// Whether it is that of a plain CSV file.
    #[must_use]
    pub fn is_plain(&self) -> bool {
        *self == Self::default()
    }
}
