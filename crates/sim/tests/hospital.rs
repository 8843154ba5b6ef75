//! A large third-party Gazebo world, with the flaws that such files have.

#![allow(clippy::unwrap_used, reason = "helpers of tests, where a panic is the failure")]

use fht_perception::pose::Point2;
use fht_sim::{FloorPlan, SimConfig, Simulator, World, load};
use std::path::PathBuf;
use std::sync::Arc;

fn folder() -> PathBuf {
    PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data/worlds/hospital"))
}

/// The hospital; `None`, and a message, if its files are missing.
fn hospital() -> Option<World> {
    let path = folder().join("worlds/hospital.world");
    if !path.exists() {
        println!("skipped, shared/data/worlds/hospital is missing: its triangles, plan and sensors");
        return None;
    }
    Some(load(&path.to_string_lossy(), None, 1).unwrap())
}

#[test]
fn the_hospital_is_loaded_despite_its_flaws() {
    let Some(world) = hospital() else { return };
    assert_eq!(world.name(), "hospital");
    // All visual meshes have 378,525; three of these have no area.
    assert_eq!(world.triangle_count(), 378_522);
    let told = world.warnings().join("\n");
    for flaw in ["StorageRack_1", "TrolleyBed_1", "WhiteChipChair_1", "floor_01_floor.png", "aws_Carpet_01.png"] {
        assert!(told.contains(flaw), "{flaw} is not told of:\n{told}");
    }
    assert_eq!(world.warnings().len(), 2, "{told}");
    let plan = world.plan();
    let start = Point2::from(world.start().translation.vector);
    assert!(!plan.is_occupied(start.x, start.y) && plan.clearance_m(start) > 0.3);
    let free_m2 = plan.free_area_m2();
    assert!((1100.0..1300.0).contains(&free_m2), "{free_m2} m2 of 27 m by 58 m");
    let reachable_m2 = plan.area_m2(&plan.reachable_free(start, 0.2));
    assert!(reachable_m2 > 0.9 * free_m2, "{reachable_m2} of {free_m2} m2");
}

/// Share of `cells` (columns and rows) that have an occupied one of `others` within `reach` cells.
fn share_near(cells: &[(i64, i64)], others: impl Fn(i64, i64) -> bool, (dx, dy): (i64, i64), reach: i64) -> f64 {
    let is_near =
        |&&(x, y): &&(i64, i64)| (-reach..=reach).any(|oy| (-reach..=reach).any(|ox| others(x + dx + ox, y + dy + oy)));
    cells.iter().filter(is_near).count() as f64 / cells.len() as f64
}

/// Cells with something in them that a free cell touches, as columns and rows from above.
fn borders(plan: &FloorPlan) -> Vec<(i64, i64)> {
    let (width, height) = (plan.width(), plan.height());
    let occupied = |x: usize, y: usize| plan.cells()[y * width + x];
    let mut borders = Vec::new();
    for y in 1..height - 1 {
        for x in 1..width - 1 {
            let free = [(x - 1, y), (x + 1, y), (x, y - 1), (x, y + 1)].iter().any(|&(x, y)| !occupied(x, y));
            if occupied(x, y) && free {
                borders.push((x as i64, (height - 1 - y) as i64));
            }
        }
    }
    borders
}

#[test]
fn the_plan_agrees_with_a_slice_made_by_others() {
    let Some(world) = hospital() else { return };
    let plan = world.plan();
    // What the meshes have at a height of 0.3 m, in cells of 5 cm, from above.
    let slice = image::open(folder().join("slice_z0.3_5cm.png")).unwrap().into_luma8();
    let is_black = |x: i64, y: i64| {
        x >= 0
            && y >= 0
            && x < slice.width().into()
            && y < slice.height().into()
            && slice.get_pixel(x as u32, y as u32).0[0] < 128
    };
    let black: Vec<(i64, i64)> =
        slice.enumerate_pixels().filter(|(.., pixel)| pixel.0[0] < 128).map(|(x, y, _)| (x.into(), y.into())).collect();
    let (width, height) = (plan.width() as i64, plan.height() as i64);
    let is_occupied = |x: i64, y: i64| {
        x >= 0 && y >= 0 && x < width && y < height && plan.cells()[((height - 1 - y) * width + x) as usize]
    };
    let borders = borders(plan);
    let is_border = |x: i64, y: i64| borders.binary_search_by_key(&(-y, x), |&(x, y)| (-y, x)).is_ok();
    // The slice's origin is unknown: the best shift counts.
    let sample: Vec<(i64, i64)> = black.iter().copied().step_by(23).collect();
    let shifts = (-30..=30).flat_map(|dx| (-60..=60).map(move |dy| (dx, dy)));
    let shift = shifts
        .max_by(|&a, &b| share_near(&sample, is_border, a, 0).total_cmp(&share_near(&sample, is_border, b, 0)))
        .unwrap();
    let found = share_near(&black, is_occupied, shift, 2);
    let inside: Vec<(i64, i64)> =
        borders.iter().copied().filter(|&(_, y)| y - shift.1 < i64::from(slice.height())).collect();
    let confirmed = share_near(&inside, is_black, (-shift.0, -shift.1), 2);
    println!(
        "shift {shift:?}: {found:.3} of the slice is in the plan, {confirmed:.3} of the plan's borders in the slice"
    );
    assert!(found > 0.9, "{found}");
    assert!(confirmed > 0.8, "{confirmed}");
}

#[test]
fn a_robot_senses_the_hospital() {
    let Some(world) = hospital() else { return };
    let world = Arc::new(world);
    let start = world.start();
    let config = SimConfig { lidar_noise_m: 0.0, ..SimConfig::default() };
    let frame = Simulator::new(Arc::clone(&world), config.clone(), start, 1).sense_first();
    let returns = frame.scan.ranges_m.iter().filter(|&&range| frame.scan.is_return(range)).count();
    assert!(returns > 180, "{returns} of 360 beams return");
    // Rays end at occupied cells of the plan.
    let plan = world.plan();
    for pose in (1..20).map(|seed| world.random_free_pose(seed, 0.3)) {
        let scan = Simulator::new(Arc::clone(&world), config.clone(), pose, 1).sense_first().scan;
        let ends = scan.ranges_m.iter().enumerate().filter(|&(_, &range)| scan.is_return(range));
        for (index, &range) in ends {
            let (sin, cos) = scan.angle(index).sin_cos();
            let range = f64::from(range);
            let end = pose * scan.base_from_sensor * Point2::new(range * cos, range * sin);
            assert!(plan.clearance_m(end) < 0.1, "a ray ends in the open at {end}");
        }
    }
    let views = frame.panorama.unwrap().views;
    let means: Vec<f64> = views
        .iter()
        .map(|view| view.as_raw().iter().map(|&value| f64::from(value)).sum::<f64>() / view.as_raw().len() as f64)
        .collect();
    assert!(means.iter().all(|mean| (60.0..245.0).contains(mean)), "{means:?}");
}

#[test]
fn a_tenth_of_its_small_models_moves() {
    let Some(world) = hospital() else { return };
    let path = folder().join("worlds/hospital.world");
    let changes = fht_sim::Changes { share: 0.1, seed: 1 };
    let later = fht_sim::load_with(&path.to_string_lossy(), None, 1, Some(&changes)).unwrap();
    assert!((4..40).contains(&later.changes()), "{}", later.changes());
    let (then, now) = (world.plan().free_area_m2(), later.plan().free_area_m2());
    assert!((then - now).abs() < 0.05 * then && then != now, "{then} m2 then, {now} now");
}
