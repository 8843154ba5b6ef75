//! Places as pictures in folders.

use crate::score::{PlaceRelation, Row};
use fht_descriptor::DescriptorNet;
use fht_proto::Descriptor;
use image::RgbImage;
use std::error::Error;
use std::path::{Path, PathBuf};

/// A query of the corridor and a reference show one place if their numbers differ by at most this,
/// as in the data set's list of accepted references.
const SAME_WITHIN: usize = 2;

/// The corridor: `ref/` and `query/` hold pictures of one walk each, in order.
pub fn corridor(net: &mut DescriptorNet, folder: &Path) -> Result<Vec<Row>, Box<dyn Error>> {
    let model = net.model().id;
    let mut describe = |name: &str| -> Result<Vec<Descriptor>, Box<dyn Error>> {
        let mut descriptors = Vec::new();
        for path in files(&folder.join(name))? {
            let components = net.picture_appearance(&[open(&path)?])?.components;
            descriptors.push(Descriptor::quantise(model, &components));
        }
        Ok(descriptors)
    };
    let (references, queries) = (describe("ref")?, describe("query")?);
    let row = |(number, query): (usize, &Descriptor)| -> Row {
        let related = |other: usize| {
            if number.abs_diff(other) <= SAME_WITHIN { PlaceRelation::Same } else { PlaceRelation::Different }
        };
        references.iter().enumerate().map(|(other, reference)| (cosine(query, reference), related(other))).collect()
    };
    Ok(queries.iter().enumerate().map(row).collect())
}

/// The cosine of two descriptors as they travel; 0 if one of them is empty.
pub fn cosine(a: &Descriptor, b: &Descriptor) -> f32 {
    a.similarity(b).unwrap_or_default()
}

fn open(path: &Path) -> Result<RgbImage, Box<dyn Error>> {
    Ok(image::open(path).map_err(|error| format!("{}: {error}", path.display()))?.to_rgb8())
}

fn files(folder: &Path) -> Result<Vec<PathBuf>, Box<dyn Error>> {
    let entries = std::fs::read_dir(folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    let mut paths = entries.map(|entry| Ok(entry?.path())).collect::<Result<Vec<_>, std::io::Error>>()?;
    paths.sort();
    Ok(paths)
}
