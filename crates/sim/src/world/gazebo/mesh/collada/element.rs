//! Elements of a COLLADA file.

use roxmltree::Node;
use std::collections::HashMap;

/// An XML element.
pub(crate) type Element<'d> = Node<'d, 'd>;

/// Elements by their tag and id: some exporters give elements of different kinds the same id.
pub(crate) type Ids<'d> = HashMap<(&'d str, &'d str), Element<'d>>;

/// The first child with this name.
pub(crate) fn child<'d>(node: Element<'d>, name: &str) -> Option<Element<'d>> {
    node.children().find(|child| child.tag_name().name() == name)
}

/// All children with this name.
pub(crate) fn children<'d>(node: Element<'d>, name: &'static str) -> impl Iterator<Item = Element<'d>> {
    node.children().filter(move |child| child.tag_name().name() == name)
}

/// The numbers of an element's text; none if one of them is malformed.
pub(crate) fn numbers(node: Element<'_>) -> Vec<f64> {
    let parsed: Option<Vec<f64>> =
        node.text().unwrap_or_default().split_ascii_whitespace().map(|word| word.parse().ok()).collect();
    parsed.unwrap_or_default()
}
