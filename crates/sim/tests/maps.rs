//! Nav2 maps: good ones, and bad ones with clear errors.

#![allow(clippy::unwrap_used, reason = "helpers of tests, where a panic is the failure")]

use fht_perception::pose::Point2;
use fht_sim::{SimConfig, SimSetup, Simulator, World, WorldError, check_world, load};
use image::{GrayImage, Luma, RgbImage};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use tempfile::TempDir;

const GOOD: &str = "image: map.pgm\nresolution: 0.05\norigin: [-1.0, -1.5, 0.0]\nnegate: 0\noccupied_thresh: 0.65\n\
                    free_thresh: 0.196\n";

/// A room of 4 m × 3 m, inner size, with a wall of one cell and a strip of the unknown at its top.
fn room() -> GrayImage {
    GrayImage::from_fn(90, 70, |x, y| {
        let inside = (5..85).contains(&x) && (5..65).contains(&y);
        let wall = (4..86).contains(&x) && (5..66).contains(&y);
        Luma([if inside {
            254
        } else if wall {
            0
        } else {
            205
        }])
    })
}

fn write(yaml: &str, picture: &GrayImage) -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    picture.save(folder.path().join("map.pgm")).unwrap();
    let path = folder.path().join("map.yaml");
    std::fs::write(&path, yaml).unwrap();
    (folder, path)
}

fn load_path(path: &Path) -> Result<World, WorldError> {
    load(&path.to_string_lossy(), None, 1)
}

fn message(yaml: &str) -> String {
    let (_folder, path) = write(yaml, &room());
    load_path(&path).err().map(|error| error.to_string()).unwrap_or_default()
}

#[test]
fn ranges_in_a_map_are_those_of_its_walls() {
    let (_folder, path) = write(GOOD, &room());
    let world = Arc::new(load_path(&path).unwrap());
    assert_eq!(world.name(), "map");
    assert!((world.plan().free_area_m2() - 12.0).abs() < 1e-9);
    // The room spans x -0.75 to 3.25 and y -1.25 to 1.75 in the map's frame.
    let config = SimConfig { lidar_noise_m: 0.0, lidar_mount_m: [0.0, 0.0, 0.182], ..SimConfig::default() };
    let start = world.start();
    assert!((start.translation.vector.norm()) < 1e-9, "the origin is free");
    let frame = Simulator::new(world, config, start, 1).sense_first();
    for (beam, range) in [(0, 3.25), (90, 1.75), (180, 0.75), (270, 1.25)] {
        assert!(
            (f64::from(frame.scan.ranges_m[beam]) - range).abs() < 1e-3,
            "beam {beam}: {}",
            frame.scan.ranges_m[beam]
        );
    }
    // All round: the box's own geometry.
    for (index, &range) in frame.scan.ranges_m.iter().enumerate() {
        let (sin, cos) = frame.scan.angle(index).sin_cos();
        let to_wall = |direction: f64, low: f64, high: f64| {
            if direction.abs() < 1e-9 {
                f64::MAX
            } else if direction > 0.0 {
                high / direction
            } else {
                low / direction
            }
        };
        let expected = to_wall(cos, -0.75, 3.25).min(to_wall(sin, -1.25, 1.75));
        assert!((f64::from(range) - expected).abs() < 2e-3, "beam {index}: {range} against {expected}");
    }
}

#[test]
fn noise_has_the_configured_size() {
    let (_folder, path) = write(GOOD, &room());
    let world = Arc::new(load_path(&path).unwrap());
    let start = world.start();
    let quiet = SimConfig { camera_every: 0, lidar_noise_m: 0.0, ..SimConfig::default() };
    let exact = Simulator::new(Arc::clone(&world), quiet.clone(), start, 1).sense_first().scan.ranges_m;
    let mut noisy = Simulator::new(world, SimConfig { lidar_noise_m: 0.01, ..quiet }, start, 1);
    let errors: Vec<f64> = (0..20)
        .flat_map(|_| noisy.sense_first().scan.ranges_m)
        .zip(exact.iter().cycle())
        .map(|(range, exact)| f64::from(range - exact))
        .collect();
    let mean = errors.iter().sum::<f64>() / errors.len() as f64;
    let sigma = (errors.iter().map(|error| (error - mean).powi(2)).sum::<f64>() / errors.len() as f64).sqrt();
    assert!(mean.abs() < 5e-4 && (0.0095..0.0105).contains(&sigma), "mean {mean}, sigma {sigma}");
}

#[test]
fn unknown_cells_close_the_world() {
    // Free floor that runs into the unknown on all sides.
    let picture = GrayImage::from_fn(60, 60, |x, y| {
        Luma([if (10..50).contains(&x) && (10..50).contains(&y) { 254 } else { 205 }])
    });
    let (_folder, path) = write(GOOD, &picture);
    let world = Arc::new(load_path(&path).unwrap());
    let start = world.start();
    let config = SimConfig { camera_every: 0, ..SimConfig::default() };
    let scan = Simulator::new(world, config, start, 1).sense_first().scan;
    assert!(scan.ranges_m.iter().all(|&range| scan.is_return(range)));
}

#[test]
fn negated_maps_turned_keys_and_other_keys_are_read() {
    let mut negative = room();
    for pixel in negative.pixels_mut() {
        pixel.0[0] = 255 - pixel.0[0];
    }
    let yaml = "mode: trinary\nmap_type: occupancy # a comment\nimage: ./map.pgm\nresolution: 5.0e-2\n\
                origin:\n  - -1\n  - -1.5\n  - 0\nnegate: true\noccupied_thresh: 0.65\nfree_thresh: 0.196\n";
    let (_folder, path) = write(yaml, &negative);
    let world = load_path(&path).unwrap();
    assert!((world.plan().free_area_m2() - 12.0).abs() < 1e-9);
    assert!(!world.plan().is_occupied(3.2, 1.7) && world.plan().is_occupied(3.3, 1.7));
}

#[test]
fn a_start_away_from_the_origin_is_found() {
    let (_folder, path) = write(&GOOD.replace("-1.0, -1.5", "10.0, 20.0"), &room());
    let world = load_path(&path).unwrap();
    let start = Point2::from(world.start().translation.vector);
    assert!(world.plan().clearance_m(start) >= 0.3);
}

#[test]
fn pictures_are_painted_on_the_walls() {
    let (folder, path) = write(GOOD, &room());
    let pictures = folder.path().join("pictures");
    std::fs::create_dir(&pictures).unwrap();
    RgbImage::from_pixel(64, 48, image::Rgb([255, 0, 255])).save(pictures.join("magenta.png")).unwrap();
    std::fs::write(pictures.join("broken.jpg"), b"no picture").unwrap();
    let magenta = |textures: Option<&Path>, seed: u64| {
        let world = Arc::new(load(&path.to_string_lossy(), textures, seed).unwrap());
        let start = world.start();
        let views = Simulator::new(world, SimConfig::default(), start, 1).sense_first().panorama.unwrap().views;
        let strong = |pixel: &image::Rgb<u8>| pixel[0] > 120 && pixel[2] > 120 && pixel[1] < 60;
        views.iter().map(|view| view.pixels().filter(|pixel| strong(pixel)).count()).sum::<usize>()
    };
    let most = (1..=4).map(|seed| magenta(Some(&pictures), seed)).max().unwrap_or(0);
    assert!(most > 2000, "{most} pixels");
    let empty = folder.path().join("empty");
    std::fs::create_dir(&empty).unwrap();
    assert!(matches!(load(&path.to_string_lossy(), Some(&empty), 1), Err(WorldError::Photographs(_))));
    assert!(load(&path.to_string_lossy(), Some(&folder.path().join("none")), 1).is_err());
    // No other world takes pictures, be they there or not.
    for world in ["museum", "office", "hall.world"] {
        assert!(matches!(load(world, Some(&pictures), 1), Err(WorldError::Textures(_))), "{world}");
    }
}

#[test]
fn the_files_of_a_world_are_known() {
    let (folder, path) = write(GOOD, &room());
    let setup = SimSetup { textures: Some("pictures".into()), ..SimSetup::of(&path.to_string_lossy()) };
    assert_eq!(setup.files(), [folder.path().join("map.pgm"), path.clone(), "pictures".into()]);
    assert_eq!(SimSetup::of("hall.world").files(), [PathBuf::from("hall.world")]);
    assert!(SimSetup::of("museum").files().is_empty());
    assert!(check_world("museum").is_ok() && check_world(&path.to_string_lossy()).is_ok());
    assert!(matches!(check_world("nowhere.yaml"), Err(WorldError::Missing(_))));
    assert!(matches!(check_world("nowhere"), Err(WorldError::Unknown(_))));
}

#[test]
fn bad_descriptions_are_refused_with_a_reason() {
    assert_eq!(message(GOOD), "");
    for (from, to, reason) in [
        ("resolution: 0.05", "resolution: 0", "resolution"),
        ("resolution: 0.05", "resolution: .nan", "resolution"),
        ("resolution: 0.05", "resolution: 1e-300", "0.001 to 1 metres"),
        ("resolution: 0.05", "resolution: 50", "0.001 to 1 metres"),
        ("resolution: 0.05", "resolution: wide", "resolution"),
        ("resolution: 0.05\n", "", "resolution"),
        ("[-1.0, -1.5, 0.0]", "[-1.0, -1.5]", "origin"),
        ("[-1.0, -1.5, 0.0]", "[-1.0, -1.5, 0.3]", "yaw"),
        ("[-1.0, -1.5, 0.0]", "[500000.0, 5400000.0, 0.0]", "shift the origin"),
        ("[-1.0, -1.5, 0.0]", "[0.0, -1.0e12, 0.0]", "over 100 km from the origin"),
        ("occupied_thresh: 0.65", "occupied_thresh: 0.1", "occupied_thresh"),
        ("free_thresh: 0.196", "free_thresh: 0.196\nmode: raw", "raw"),
        ("free_thresh: 0.196", "free_thresh: 0.196\nmode: cubist", "mode"),
        ("image: map.pgm", "image: missing.pgm", "missing.pgm"),
        ("image: map.pgm", "image: map.yaml", "picture"),
        ("image: map.pgm", "image: [", "no map description"),
    ] {
        let message = message(&GOOD.replace(from, to));
        assert!(message.contains(reason), "{to:?}: {message:?} does not say {reason:?}");
    }
    assert!(load_path(Path::new("/nonexistent/map.yaml")).is_err());
}

#[test]
fn broken_pictures_never_panic() {
    let (folder, path) = write(GOOD, &room());
    let picture = folder.path().join("map.pgm");
    let whole = std::fs::read(&picture).unwrap();
    let huge = b"P5\n1000000 1000000\n255\n".to_vec();
    for bytes in [vec![], b"P5".to_vec(), whole[..whole.len() / 2].to_vec(), b"P9\n1 1\n255\n0".to_vec(), huge] {
        std::fs::write(&picture, &bytes).unwrap();
        assert!(load_path(&path).is_err(), "{} bytes", bytes.len());
    }
}

#[test]
fn a_map_without_floor_is_refused() {
    for (yaml, grey) in [(GOOD, 0), (GOOD, 205), (&GOOD.replace("negate: 0", "negate: 1"), 254)] {
        let (_folder, path) = write(yaml, &GrayImage::from_pixel(20, 20, Luma([grey])));
        let error = load_path(&path).unwrap_err();
        let said = error.to_string();
        assert!(matches!(error, WorldError::Empty(_, _)), "{said}");
        assert!(said.contains("world 'map' has no free floor: are `negate`"), "{said}");
    }
}

/// The paper's floor plans may lie next to the checkout; they are not part of the project.
#[test]
fn the_papers_maps_load_where_they_are_at_hand() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/maps");
    for (file, free) in [("museum.yaml", 318.2), ("large_indoor.yaml", 1304.9)] {
        let path = folder.join(file);
        if !path.exists() {
            eprintln!("skipped: {} is not there", path.display());
            continue;
        }
        let world = load_path(&path).unwrap();
        assert!((world.plan().free_area_m2() - free).abs() < 0.1, "{}", world.plan().free_area_m2());
        let start = Point2::from(world.start().translation.vector);
        let reachable = world.plan().area_m2(&world.plan().reachable_free(start, 0.2));
        assert!(reachable > 0.99 * free, "{file}: {reachable}");
    }
}

#[test]
fn small_pieces_of_a_map_move_and_new_things_come_while_the_walls_stay() {
    // A hall of 20 m by 12 m with posts of 0.4 m, 2 m apart.
    let picture = GrayImage::from_fn(420, 260, |x, y| {
        let inside = (10..410).contains(&x) && (10..250).contains(&y);
        let post = x % 40 < 8 && y % 40 < 8 && (40..400).contains(&x) && (40..240).contains(&y);
        Luma([if inside && !post { 254 } else { 0 }])
    });
    let (_folder, path) = write(GOOD, &picture);
    let then = load_path(&path).unwrap();
    let (mut fewer, mut more) = (0, 0);
    for seed in 0..6 {
        let changes = fht_sim::Changes { share: 0.1, seed };
        let later = fht_sim::load_with(&path.to_string_lossy(), None, 1, Some(&changes)).unwrap();
        assert!((4..=6).contains(&later.changes()), "a tenth of some 45 posts: {}", later.changes());
        let pairs = || then.plan().cells().iter().zip(later.plan().cells());
        fewer += pairs().filter(|(before, after)| **before && !**after).count();
        more += pairs().filter(|(before, after)| !**before && **after).count();
        // The outer walls are where they were, and look the same.
        let edge = (0..420).all(|column| later.plan().cells()[5 * 420 + column]);
        assert!(edge && later.triangle_count() > 100);
    }
    assert!(fewer > 64 && more > 64, "{fewer} cells free that were not, {more} the other way round");
}

#[test]
fn a_large_plan_without_a_wall_is_loaded() {
    // Some 11,000 squares of different looks, and 9 million cells that ask in which they are.
    let yaml = GOOD.replace("0.05", "0.25");
    let (_folder, path) = write(&yaml, &GrayImage::from_pixel(3000, 3000, Luma([254])));
    let world = load_path(&path).unwrap();
    assert!((world.plan().free_area_m2() - 750.0 * 750.0).abs() < 1e-3);
    assert!(world.plan().reachable(Point2::from(world.start().translation.vector), 0.2).count() > 8_000_000);
}
