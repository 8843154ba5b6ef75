//! What a COLLADA material looks like: its diffuse colour or picture.

use super::element::{Element, Ids, child, children, numbers};
use crate::world::gazebo::mesh::Paint;

/// The paint of a `<material>`.
pub(super) fn paint<'d>(material: Element<'d>, root: Element<'d>, ids: &Ids<'d>) -> Option<Paint> {
    let effect = child(material, "instance_effect")?.attribute("url")?;
    let profile = child(*ids.get(&("effect", effect.trim_start_matches('#')))?, "profile_COMMON")?;
    let technique = child(profile, "technique")?;
    let shading = technique
        .children()
        .find(|node| matches!(node.tag_name().name(), "phong" | "lambert" | "blinn" | "constant"))?;
    // A material that only emits light has no other colour.
    let seen = child(shading, "diffuse").or_else(|| child(shading, "emission"))?;
    let colour = child(seen, "color").map(numbers).and_then(|values| {
        let &[red, green, blue, ..] = values.as_slice() else { return None };
        Some([red as f32, green as f32, blue as f32])
    });
    let texture = child(seen, "texture").and_then(|node| node.attribute("texture"));
    let picture = texture.and_then(|name| picture(name, profile, root, ids));
    if colour.is_none() && texture.is_none() {
        return None;
    }
    Some(Paint { colour: colour.unwrap_or([0.8; 3]), picture })
}

/// The file that a texture's name refers to: through a sampler and a surface, through a sampler's
/// image (1.5), or, as some exporters write it, directly by the image's id.
fn picture<'d>(name: &str, profile: Element<'d>, root: Element<'d>, ids: &Ids<'d>) -> Option<String> {
    let parameter = |sid: &str| {
        let own = children(profile, "newparam").find(|node| node.attribute("sid") == Some(sid));
        own.or_else(|| {
            root.descendants().find(|node| node.tag_name().name() == "newparam" && node.attribute("sid") == Some(sid))
        })
    };
    let text = |node: Element<'d>| node.text().map(str::trim).filter(|text| !text.is_empty());
    let mut image = None;
    if let Some(sampler) = parameter(name).and_then(|node| child(node, "sampler2D")) {
        image = child(sampler, "instance_image")
            .and_then(|node| node.attribute("url"))
            .map(|url| url.trim_start_matches('#'))
            .or_else(|| {
                let surface = parameter(child(sampler, "source").and_then(text)?)?;
                child(child(surface, "surface")?, "init_from").and_then(text)
            });
    }
    let image = ids.get(&("image", image.unwrap_or(name))).copied()?;
    let from = child(image, "init_from")?;
    text(from).or_else(|| child(from, "ref").and_then(text)).map(str::to_owned)
}
