//! The built-in network on drawn pictures.

use crate::files::{BUILT_IN_DESCRIPTION, BUILT_IN_ONNX, BUILT_IN_PROJECTION};
use crate::information::information;
use crate::{DescribeError, Description, DescriptorNet};
use fht_perception::frame::Panorama;
use image::{Rgb, RgbImage};
use std::path::Path;

/// A panorama of four views of a drawn ring of coloured stripes and blobs, the robot turned by
/// `turn` quarter turns.
fn ring(seed: u32, turn: usize, gain: f32) -> Panorama {
    let view = |side: u32| {
        RgbImage::from_fn(96, 96, |x, y| {
            let column = side * 96 + x;
            let wave = |scale: u32, shift: u32| {
                let phase = (column * (scale + seed % 5) + shift * seed + y * (scale / 2 + seed % 3)) as f32 / 37.0;
                ((phase.sin() * 0.5 + 0.5) * 200.0 * gain).min(255.0) as u8
            };
            let blob = (column / 24 + y / 24 + seed).is_multiple_of(3);
            if blob { Rgb([wave(3, 1), wave(5, 2), 40]) } else { Rgb([60, wave(7, 3), wave(2, 5)]) }
        })
    };
    // Views are ahead, left, behind, right; a turn to the left brings the left view ahead.
    Panorama { views: [0, 1, 2, 3].map(|index| view(((index + turn) % 4) as u32)) }
}

fn cosine(a: &[f32], b: &[f32]) -> f32 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[test]
fn a_descriptor_is_a_unit_vector_that_quarter_turns_and_light_leave_alone() {
    let mut net = DescriptorNet::load(None).unwrap();
    let reference = net.describe(&ring(3, 0, 1.0)).unwrap();
    assert_eq!(reference.len(), usize::from(net.model().dimension));
    assert!((cosine(&reference, &reference) - 1.0).abs() < 1e-4);
    for turn in 1..4 {
        let turned = net.describe(&ring(3, turn, 1.0)).unwrap();
        assert!(cosine(&reference, &turned) > 0.9999, "{turn} quarter turns: {}", cosine(&reference, &turned));
    }
    let darker = net.describe(&ring(3, 0, 0.6)).unwrap();
    let other = net.describe(&ring(11, 0, 1.0)).unwrap();
    let (same_place, other_place) = (cosine(&reference, &darker), cosine(&reference, &other));
    assert!(same_place > 0.9 && same_place > other_place, "darker {same_place}, elsewhere {other_place}");
    assert_eq!(net.describe(&ring(3, 0, 1.0)).unwrap(), reference, "the same picture gives the same numbers");
}

/// A panorama of a sky of coloured patches, the robot's heading `yaw` radians.
fn patches(seed: u32, yaw: f64) -> Panorama {
    let view = |side: usize| {
        RgbImage::from_fn(160, 160, |x, y| {
            let (right, down) = ((f64::from(x) + 0.5) / 80.0 - 1.0, (f64::from(y) + 0.5) / 80.0 - 1.0);
            let azimuth = yaw + side as f64 * std::f64::consts::FRAC_PI_2 - right.atan();
            let height = -down / (1.0 + right * right).sqrt();
            let wave = |scale: f64, shift: f64| {
                let turn = azimuth * f64::from((scale * f64::from(seed)).round() as i32);
                ((turn.sin() + (height * 9.0 * scale + shift).cos()) * 50.0 + 120.0) as u8
            };
            Rgb([wave(1.0, 0.3), wave(2.0, 1.1), wave(3.0, 2.0)])
        })
    };
    Panorama { views: [0, 1, 2, 3].map(view) }
}

#[test]
fn any_heading_gives_nearly_the_same_descriptor() {
    let mut net = DescriptorNet::load(None).unwrap();
    let reference = net.describe(&patches(3, 0.0)).unwrap();
    let elsewhere = net.describe(&patches(7, 0.0)).unwrap();
    let other_place = cosine(&reference, &elsewhere);
    for yaw in [0.1, 0.7, 1.3, 2.9, 4.4] {
        let turned = cosine(&reference, &net.describe(&patches(3, yaw)).unwrap());
        assert!(turned > 0.95 && turned > other_place + 0.1, "yaw {yaw}: {turned}, elsewhere {other_place}");
    }
}

#[test]
fn information_is_the_entropy_of_the_components() {
    // All components equal: one interval, no information. Spread evenly over all intervals: the
    // most possible.
    assert!(information(&[0.05; 400], 4.0).abs() < 1e-12);
    let spread: Vec<f32> = (0..400).map(|index| index as f32 / 400.0 * 0.2).collect();
    assert!((information(&spread, 4.0) - 1.0).abs() < 1e-3, "{}", information(&spread, 4.0));
    let mut net = DescriptorNet::load(None).unwrap();
    let rich = net.appearance(&ring(5, 0, 1.0)).unwrap();
    assert!((0.3..=1.0).contains(&rich.information), "{}", rich.information);
}

#[test]
fn odd_pictures_are_described_or_refused() {
    let mut net = DescriptorNet::load(None).unwrap();
    let tiny = RgbImage::from_pixel(1, 1, Rgb([9, 9, 9]));
    assert!(net.picture_appearance(&[tiny.clone(), RgbImage::new(30, 70)]).is_ok());
    assert!(matches!(net.picture_appearance(&[]), Err(DescribeError::Empty)));
    assert!(matches!(net.picture_appearance(&[tiny.clone(), RgbImage::new(0, 5)]), Err(DescribeError::Empty)));
    let mixed = [tiny.clone(), RgbImage::new(30, 70), tiny, RgbImage::new(2, 300)];
    assert!(net.describe(&Panorama { views: mixed.clone() }).is_ok());
    let [first, second, third, _] = mixed;
    let hole = Panorama { views: [first, second, third, RgbImage::new(0, 0)] };
    assert!(matches!(net.describe(&hole), Err(DescribeError::Empty)));
}

#[test]
fn descriptions_that_make_no_sense_are_refused() {
    let refused = |from: &str, to: &str| {
        assert!(BUILT_IN_DESCRIPTION.contains(from), "{from}");
        let error = Description::parse(&BUILT_IN_DESCRIPTION.replacen(from, to, 1)).err();
        error.map(|error| error.to_string()).unwrap_or_default()
    };
    assert!(refused("\"dimension\": 256", "\"dimension\": 513").contains("dimension is 513"));
    assert!(refused("\"channels\": 384", "\"channels\": 300").contains("mean is 384 numbers"));
    assert!(refused("\"view_px\": 160", "\"view_px\": 0").contains("view_px"));
    assert!(refused("\"gem_power\": 3.0", "\"gem_power\": -1.0").contains("gem_power"));
    assert!(refused("\"match_threshold\": 0.", "\"match_threshold\": 7.").contains("match_threshold"));
    assert!(refused("mobilenet-v2-b11.projection", "../elsewhere").contains("beside the description"));
    assert!(refused("\"name\"", "\"nom\"").contains("not a model description"));
    let without = BUILT_IN_DESCRIPTION.replacen("\"mobilenet-v2-b11.projection\"", "null", 1);
    let error = Description::parse(&without).err().map(|error| error.to_string()).unwrap_or_default();
    assert!(error.contains("as many as channels"), "{error}");
}

#[test]
fn a_model_of_ones_own_is_loaded_and_a_broken_one_refused_with_a_reason() {
    let folder = tempfile::tempdir().unwrap();
    let onnx = folder.path().join("own.onnx");
    let json = folder.path().join("own.json");
    let text = |path: &Path| DescriptorNet::load(Some(path)).err().map(|error| error.to_string()).unwrap_or_default();
    assert!(text(&onnx).contains("own.onnx cannot be read"), "{}", text(&onnx));
    std::fs::write(&onnx, BUILT_IN_ONNX).unwrap();
    assert!(text(&onnx).contains("own.json cannot be read"), "{}", text(&onnx));
    std::fs::write(&json, "{}").unwrap();
    assert!(text(&onnx).contains("not a model description"), "{}", text(&onnx));
    let projection = folder.path().join("mobilenet-v2-b11.projection");
    std::fs::write(&json, BUILT_IN_DESCRIPTION).unwrap();
    assert!(text(&onnx).contains("mobilenet-v2-b11.projection cannot be read"), "{}", text(&onnx));
    std::fs::write(&projection, &BUILT_IN_PROJECTION[..100]).unwrap();
    assert!(text(&onnx).contains("not 100"), "{}", text(&onnx));
    std::fs::write(&projection, BUILT_IN_PROJECTION).unwrap();
    let wrong = BUILT_IN_DESCRIPTION.replace("\"features\"", "\"elsewhere\"");
    std::fs::write(&json, wrong).unwrap();
    assert!(text(&onnx).contains("no output 'elsewhere'"), "{}", text(&onnx));
    std::fs::write(&json, BUILT_IN_DESCRIPTION.replace("\"mobilenet-v2-b11\"", "\"own\"")).unwrap();
    let own = DescriptorNet::load(Some(&onnx)).unwrap();
    assert_eq!(own.model().name, "own");
    assert_ne!(own.model().id, DescriptorNet::load(None).unwrap().model().id);
    let named = |hash: &str| BUILT_IN_DESCRIPTION.replacen('{', &format!("{{\"onnx_blake3\": \"{hash}\","), 1);
    std::fs::write(&json, named(blake3::hash(BUILT_IN_ONNX).to_hex().as_str())).unwrap();
    assert_eq!(text(&onnx), "");
    std::fs::write(&json, named(blake3::hash(b"another network").to_hex().as_str())).unwrap();
    assert!(text(&onnx).contains("own.onnx was altered"), "{}", text(&onnx));
    std::fs::write(&json, BUILT_IN_DESCRIPTION).unwrap();
    std::fs::write(&onnx, b"no network").unwrap();
    assert!(text(&onnx).contains("cannot be loaded as an ONNX model"), "{}", text(&onnx));
}
