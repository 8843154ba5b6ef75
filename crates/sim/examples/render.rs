//! Draws a world: its plan from above, and panoramas from some places, as PNG files.
//!
//! `cargo run --release -p fht-sim --example render -- museum --out out/museum`

use fht_perception::frame::Panorama;
use fht_perception::pose::{Point2, Pose2};
use fht_sim::{SimConfig, Simulator, World, load};
use image::{Rgb, RgbImage, imageops};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

const USAGE: &str = "usage: render WORLD [--out DIR] [--textures DIR] [--seed N] [--light N] [--places N] [--pixels N]";

struct Options {
    world: String,
    out: PathBuf,
    textures: Option<PathBuf>,
    seed: u64,
    light: u64,
    places: u64,
    pixels: u32,
}

fn options() -> Option<Options> {
    let mut arguments = std::env::args().skip(1);
    let mut options = Options {
        world: arguments.next()?,
        out: PathBuf::from("out"),
        textures: None,
        seed: 1,
        light: 0,
        places: 6,
        pixels: 320,
    };
    while let Some(flag) = arguments.next() {
        let value = arguments.next()?;
        match flag.as_str() {
            "--out" => options.out = value.into(),
            "--textures" => options.textures = Some(value.into()),
            "--seed" => options.seed = value.parse().ok()?,
            "--light" => options.light = value.parse().ok()?,
            "--places" => options.places = value.parse().ok()?,
            "--pixels" => options.pixels = value.parse().ok()?,
            _ => return None,
        }
    }
    Some(options)
}

/// Left to right: left, ahead, right, behind.
fn side_by_side(panorama: &Panorama) -> RgbImage {
    let side = panorama.views[0].width();
    let mut sheet = RgbImage::new(side * 4, side);
    for (place, view) in [1, 0, 3, 2].into_iter().enumerate() {
        imageops::replace(&mut sheet, &panorama.views[view], i64::from(side) * place as i64, 0);
    }
    sheet
}

fn from_above(world: &World, poses: &[Pose2]) -> RgbImage {
    let plan = world.plan();
    let reachable = plan.reachable(Point2::from(world.start().translation.vector), 0.2);
    let mut sheet = RgbImage::from_fn(plan.width() as u32, plan.height() as u32, |x, y| {
        let (column, row) = (x as usize, plan.height() - 1 - y as usize);
        match (plan.cells()[row * plan.width() + column], reachable.contains(column, row)) {
            (true, _) => Rgb([40, 40, 48]),
            (false, true) => Rgb([250, 250, 246]),
            (false, false) => Rgb([206, 214, 222]),
        }
    });
    for pose in poses {
        if let Some((column, row)) = plan.cell_of(Point2::from(pose.translation.vector)) {
            for (dx, dy) in (-3..=3).flat_map(|dx| (-3..=3).map(move |dy| (dx, dy))) {
                let (x, y) = (column as i64 + dx, plan.height() as i64 - 1 - row as i64 + dy);
                if x >= 0 && y >= 0 && x < i64::from(sheet.width()) && y < i64::from(sheet.height()) {
                    sheet.put_pixel(x as u32, y as u32, Rgb([220, 40, 40]));
                }
            }
        }
    }
    sheet
}

fn main() {
    if let Err(error) = run() {
        eprintln!("{error}"); // an error that main returns is printed with Debug
        std::process::exit(1);
    }
}

fn run() -> Result<(), Box<dyn std::error::Error>> {
    let Some(options) = options() else {
        return Err(USAGE.into());
    };
    std::fs::create_dir_all(&options.out)?;
    let began = Instant::now();
    let world = Arc::new(load(&options.world, options.textures.as_deref(), options.seed)?);
    let plan = world.plan();
    let start = Point2::from(world.start().translation.vector);
    println!(
        "{}: {} triangles, {:.1} m x {:.1} m, {:.1} m2 free, {:.1} m2 within reach of a robot of 0.105 m, {:.1} m2 of 0.2 m; loaded in {:.2} s",
        world.name(),
        world.triangle_count(),
        plan.width() as f64 * plan.resolution_m(),
        plan.height() as f64 * plan.resolution_m(),
        plan.free_area_m2(),
        plan.area_m2(&plan.reachable_free(start, 0.105)),
        plan.area_m2(&plan.reachable_free(start, 0.2)),
        began.elapsed().as_secs_f64()
    );
    for warning in world.warnings() {
        println!("warning: {warning}");
    }
    let mut poses = vec![world.start()];
    poses.extend((1..options.places).map(|place| world.random_free_pose(place, 0.4)));
    from_above(&world, &poses).save(options.out.join("plan.png"))?;
    for (place, &pose) in poses.iter().enumerate() {
        let config = SimConfig { view_pixels: options.pixels, light_seed: options.light, ..SimConfig::default() };
        let mut simulator = Simulator::new(Arc::clone(&world), config, pose, 1);
        if let Some(panorama) = simulator.sense_first().panorama {
            side_by_side(&panorama).save(options.out.join(format!("place-{place}.png")))?;
        }
    }
    let measured = SimConfig::default();
    let mut simulator =
        Simulator::new(Arc::clone(&world), SimConfig { camera_every: 1, ..measured.clone() }, poses[0], 1);
    let began = Instant::now();
    for _ in 0..20 {
        simulator.sense_first();
    }
    let with_cameras = began.elapsed().as_secs_f64() / 20.0;
    let mut simulator = Simulator::new(Arc::clone(&world), SimConfig { camera_every: 0, ..measured }, poses[0], 1);
    let began = Instant::now();
    for _ in 0..200 {
        simulator.sense_first();
    }
    let scan_only = began.elapsed().as_secs_f64() / 200.0;
    println!("{:.2} ms a panorama, {:.3} ms a scan", 1e3 * (with_cameras - scan_only), 1e3 * scan_only);
    Ok(())
}
