//! Elements of an SDF file.

use roxmltree::Node;

/// The first child element with this name.
pub(crate) fn child<'a, 'input>(node: Node<'a, 'input>, name: &str) -> Option<Node<'a, 'input>> {
    node.children().find(|child| child.has_tag_name(name))
}

/// The name of an element, else of its model, for reports.
pub(crate) fn name_of(node: Node<'_, '_>) -> String {
    let name = |node: Node<'_, '_>| {
        node.attribute("name").map(str::to_owned).or_else(|| Some(child(node, "name")?.text()?.trim().to_owned()))
    };
    let parent = || node.ancestors().skip(1).find(|ancestor| ancestor.has_tag_name("model")).and_then(name);
    match node.tag_name().name() {
        "model" => name(node),
        _ => parent().or_else(|| name(node)),
    }
    .unwrap_or_else(|| node.tag_name().name().to_owned())
}
