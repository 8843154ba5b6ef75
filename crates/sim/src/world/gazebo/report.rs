//! What a world's files lack or get wrong, collected so that each kind of flaw is reported once.

use std::collections::BTreeMap;

/// Names listed for each kind of flaw; the others are counted.
const MOST_NAMES: usize = 8;
/// Longest name listed, characters: files may contain anything.
const LONGEST_NAME: usize = 120;

/// A kind of flaw that does not keep a world from being loaded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Flaw {
    /// An included model was not found.
    Model,
    /// An included model's file is malformed.
    ModelFile,
    /// Models include each other in a circle, or too deeply.
    Nesting,
    /// A pose or size is not a number, or far outside any building.
    Number,
    /// A pose is where nothing of a map may be.
    Remote,
    /// A frame of reference is unknown.
    Frame,
    /// A shape's kind is not supported, or it lacks its sizes.
    Shape,
    /// An element of the world is not supported.
    Element,
    /// A mesh cannot be read.
    Mesh,
    /// Some triangles of a mesh are malformed.
    Triangles,
    /// A picture is missing or cannot be read.
    Picture,
    /// A material's name is unknown.
    Material,
    /// The world is too large.
    Extent,
    /// The floor is open to the outside.
    Open,
}

impl Flaw {
    /// What is wrong, and what is done about it.
    fn sentence(self) -> &'static str {
        match self {
            Self::Model => "models not found, left out",
            Self::ModelFile => "models that cannot be read, left out",
            Self::Nesting => "includes in a circle, too deep or too many, left out",
            Self::Number => "numbers missing, not finite or out of bounds, set to their defaults",
            Self::Remote => "poses over 100 km from the origin",
            Self::Frame => "frames of reference unknown, taken as the parent's",
            Self::Shape => "shapes not supported or without proper sizes, left out",
            Self::Element => "elements not supported, left out",
            Self::Mesh => "meshes that cannot be read, left out",
            Self::Triangles => "meshes with malformed triangles, which are left out",
            Self::Picture => "pictures missing or unreadable, plain colours instead",
            Self::Material => "materials unknown, grey instead",
            Self::Extent => "parts too far out or too many, cut off",
            Self::Open => "floor open to the outside, closed by a fence",
        }
    }
}

/// The flaws found so far.
#[derive(Debug, Default)]
pub(crate) struct ImportReport {
    found: BTreeMap<Flaw, BTreeMap<String, usize>>,
}

impl ImportReport {
    /// Notes a flaw.
    pub(crate) fn note(&mut self, flaw: Flaw, what: impl AsRef<str>) {
        let name = what.as_ref().chars().take(LONGEST_NAME).collect();
        *self.found.entry(flaw).or_default().entry(name).or_default() += 1;
    }

    /// One sentence for each kind of flaw.
    pub(crate) fn sentences(&self) -> Vec<String> {
        self.found.keys().filter_map(|flaw| self.sentence(*flaw)).collect()
    }

    /// The sentence for one kind of flaw, if there is one of it.
    pub(crate) fn sentence(&self, flaw: Flaw) -> Option<String> {
        let names = self.found.get(&flaw)?;
        let told =
            |name: &String, times: usize| if times > 1 { format!("{name} ({times} times)") } else { name.clone() };
        let shown: Vec<String> = names.iter().take(MOST_NAMES).map(|(name, &times)| told(name, times)).collect();
        let rest = names.len().saturating_sub(MOST_NAMES);
        let more = if rest > 0 { format!(" and {rest} more") } else { String::new() };
        Some(format!("{}: {}{more}", flaw.sentence(), shown.join(", ")))
    }
}

#[cfg(test)]
mod tests {
    use super::{Flaw, ImportReport};

    #[test]
    fn each_sort_of_flaw_is_told_once() {
        let mut report = ImportReport::default();
        for index in 0..20 {
            report.note(Flaw::Picture, format!("{index:02}.png"));
        }
        report.note(Flaw::Model, "chair");
        report.note(Flaw::Model, "chair");
        let sentences = report.sentences();
        assert_eq!(sentences[0], "models not found, left out: chair (2 times)");
        assert!(sentences[1].ends_with("07.png and 12 more"), "{}", sentences[1]);
        assert_eq!(sentences.len(), 2);
    }
}
