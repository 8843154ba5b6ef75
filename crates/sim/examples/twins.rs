//! Draws buildings whose parts look alike, as Nav2 maps: `halves` (two equal wings one after the
//! other, a lobby between), `floors` (two floors that differ in a thing each, a ramp between) and
//! `turned` (two wings back to back: nearly the same, turned by half a turn).
//!
//! `cargo run --release -p fht-sim --example twins -- out/twins`

use std::path::{Path, PathBuf};

/// Left, lower, right and upper edge, metres.
type Area = [f64; 4];

/// Side of a cell, metres.
const CELL_M: f64 = 0.05;
/// How thick walls are, metres.
const WALL_M: f64 = 0.15;
const UNKNOWN: u8 = 205;
const FREE: u8 = 254;
const WALL: u8 = 0;

/// A part of a building: its rooms, the doors in their walls, and the things in them.
#[derive(Default)]
struct Part {
    rooms: Vec<Area>,
    doors: Vec<Area>,
    things: Vec<Area>,
}

impl Part {
    /// A corridor of 24 m from this corner on, with six rooms of all sorts of sizes on each side.
    fn wing(x: f64, y: f64) -> Self {
        let mut wing = Self { rooms: vec![[x, y + 5.3, x + 24.0, y + 7.3]], ..Self::default() };
        let mut left = x;
        for (number, width) in [4.0, 3.5, 5.0, 3.0, 4.2, 3.55].into_iter().enumerate() {
            let right = (left + width - 0.15).min(x + 24.0);
            let along = 0.5 + 0.2 * number as f64;
            let depth = 4.0 + 0.4 * (number % 3) as f64;
            wing.rooms.push([left, y, right, y + 5.0]);
            wing.rooms.push([left, y + 7.6, right, y + 7.6 + depth]);
            wing.doors.push([left + 1.0, y + 4.9, left + 2.0, y + 5.4]);
            wing.doors.push([left + along, y + 7.2, left + along + 1.0, y + 7.7]);
            wing.things.push([left + 0.4, y + 0.4, left + 1.6, y + 1.1]);
            wing.things.push([right - 0.9, y + 10.0, right - 0.1, y + 10.8]);
            if number % 2 == 1 {
                wing.things.push([right - 0.7, y + 0.1, right - 0.1, y + 2.0]);
            }
            left += width;
        }
        wing
    }

    /// A room with doors and things.
    fn room(room: Area, doors: &[Area], things: &[Area]) -> Self {
        Self { rooms: vec![room], doors: doors.to_vec(), things: things.to_vec() }
    }

    fn with(mut self, other: Self) -> Self {
        self.rooms.extend(other.rooms);
        self.doors.extend(other.doors);
        self.things.extend(other.things);
        self
    }

    fn with_thing(mut self, thing: Area) -> Self {
        self.things.push(thing);
        self
    }

    /// Turned by half a turn in a building of this size.
    fn turned(self, (width, height): (f64, f64)) -> Self {
        let turn = |areas: Vec<Area>| {
            areas.into_iter().map(|[x0, y0, x1, y1]| [width - x1, height - y1, width - x0, height - y0]).collect()
        };
        Self { rooms: turn(self.rooms), doors: turn(self.doors), things: turn(self.things) }
    }

    /// Writes it as the map `name` of this size, metres.
    fn write(&self, folder: &Path, name: &str, size: (f64, f64)) -> std::io::Result<()> {
        let (width, height) = ((size.0 / CELL_M) as usize, (size.1 / CELL_M) as usize);
        let mut cells = vec![UNKNOWN; width * height];
        let mut fill = |[x0, y0, x1, y1]: Area, by: f64, shade: u8| {
            let cell = |metres: f64, most: usize| ((metres / CELL_M).round().max(0.0) as usize).min(most);
            let (left, right) = (cell(x0 - by, width), cell(x1 + by, width));
            for row in cell(y0 - by, height)..cell(y1 + by, height) {
                cells[row * width + left..row * width + right].fill(shade);
            }
        };
        self.rooms.iter().for_each(|room| fill(*room, WALL_M, WALL));
        self.rooms.iter().chain(&self.doors).for_each(|area| fill(*area, 0.0, FREE));
        self.things.iter().for_each(|thing| fill(*thing, 0.0, WALL));
        let mut picture = format!("P5\n{width} {height}\n255\n").into_bytes();
        cells.chunks(width).rev().for_each(|row| picture.extend(row));
        std::fs::write(folder.join(format!("{name}.pgm")), picture)?;
        let map = format!(
            "image: {name}.pgm\nresolution: {CELL_M}\norigin: [-2.0, -2.0, 0.0]\nnegate: 0\noccupied_thresh: 0.65\n\
             free_thresh: 0.196\n"
        );
        std::fs::write(folder.join(format!("{name}.yaml")), map)
    }
}

fn draw(folder: &Path) -> std::io::Result<()> {
    std::fs::create_dir_all(folder)?;
    let lobby_doors = [[25.9, 7.4, 26.4, 9.2], [31.6, 7.4, 32.1, 9.2]];
    let lobby = Part::room([26.3, 4.0, 31.7, 11.0], &lobby_doors, &[[27.5, 4.6, 29.0, 5.2]]);
    Part::wing(2.0, 2.0).with(Part::wing(32.0, 2.0)).with(lobby).write(folder, "halves", (58.5, 18.0))?;

    let below = Part::wing(2.0, 2.0).with_thing([7.2, 3.5, 8.2, 4.2]);
    let above = Part::wing(2.0, 22.0).with_thing([17.0, 23.0, 18.0, 23.6]);
    let ramp = Part::room([27.0, 7.3, 29.0, 29.3], &[[25.9, 7.6, 27.1, 9.0], [25.9, 27.6, 27.1, 29.0]], &[]);
    below.with(above).with(ramp).write(folder, "floors", (32.0, 38.0))?;

    let size = (62.0, 18.0);
    let hall_doors = [[25.9, 7.4, 26.4, 9.2], [35.6, 8.8, 36.1, 10.6]];
    let hall_things = [[30.0, 8.0, 32.0, 9.5], [34.0, 5.2, 35.5, 5.9]];
    let hall = Part::room([26.3, 5.0, 35.7, 13.0], &hall_doors, &hall_things);
    Part::wing(2.0, 2.0).with(Part::wing(2.0, 2.0).turned(size)).with(hall).write(folder, "turned", size)
}

fn main() -> std::process::ExitCode {
    let Some(folder) = std::env::args_os().nth(1).map(PathBuf::from) else {
        eprintln!("usage: twins FOLDER");
        return std::process::ExitCode::from(2);
    };
    match draw(&folder) {
        Ok(()) => std::process::ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("twins: {}: {error}", folder.display());
            std::process::ExitCode::FAILURE
        }
    }
}
