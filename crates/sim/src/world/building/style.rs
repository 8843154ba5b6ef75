//! How a part of a building looks: wall finish, floor, and what hangs on the walls.

use crate::world::draw::art::{self, GENRES, Genre};
use crate::world::draw::canvas::Rgb;
use crate::world::draw::surfaces::{FloorSurface, Wall};
use crate::world::draw::{Panel, fittings};
use image::RgbImage;
use rand::{Rng, RngExt};

/// Something that hangs on a wall.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Hanging {
    /// A painting of one genre.
    Painting(Genre),
    /// One of the user's photographs; a painting if there are none.
    Photograph,
    /// A painting of any genre.
    AnyPainting,
    /// A poster.
    Poster,
    /// A relief in stone.
    Relief,
    /// A window.
    Window,
    /// A door of this colour.
    Door(Rgb),
    /// A whiteboard.
    Whiteboard,
    /// A notice board.
    NoticeBoard,
    /// A text with a title.
    Text(&'static str),
    /// A direction sign.
    Sign(&'static str, Rgb),
    /// A fire extinguisher.
    Extinguisher,
    /// A clock.
    Clock,
    /// A map.
    Map,
}

impl Hanging {
    /// Draws it.
    pub(crate) fn draw(self, photographs: &[RgbImage], rng: &mut impl Rng) -> Panel {
        match self {
            Self::Photograph if !photographs.is_empty() => {
                let which = rng.random_range(0..photographs.len());
                art::photograph(&photographs[which], rng)
            }
            Self::Painting(genre) => art::painting(genre, rng),
            Self::AnyPainting | Self::Photograph => {
                let genre = GENRES[rng.random_range(0..GENRES.len())];
                art::painting(genre, rng)
            }
            Self::Poster => art::poster(rng),
            Self::Relief => art::relief(rng),
            Self::Window => fittings::window(rng),
            Self::Door(colour) => {
                let number = rng.random_range(100..999);
                fittings::door(colour, number, rng)
            }
            Self::Whiteboard => fittings::whiteboard(rng),
            Self::NoticeBoard => fittings::notice_board(rng),
            Self::Text(title) => fittings::text_panel(title, rng),
            Self::Sign(text, colour) => fittings::sign(text, colour),
            Self::Extinguisher => fittings::extinguisher(),
            Self::Clock => fittings::clock(rng),
            Self::Map => fittings::wall_map(rng),
        }
    }
}

/// What hangs on the walls of a zone.
#[derive(Clone, Debug)]
pub(crate) struct Hangings {
    /// What to choose from.
    pub(crate) choice: Vec<Hanging>,
    /// Shortest and longest gap between two of them, metres.
    pub(crate) gap_m: (f64, f64),
    /// Whether all of one kind are copies of one drawing: a place that repeats itself.
    pub(crate) copies: bool,
    /// Colour of the doors in niches; `None`: niches are bare.
    pub(crate) niche_door: Option<Rgb>,
}

/// The look of a zone.
#[derive(Clone, Debug)]
pub(crate) struct Style {
    /// Finish of its walls.
    pub(crate) wall: Wall,
    /// Its floor.
    pub(crate) floor: FloorSurface,
    /// What hangs on its walls.
    pub(crate) hangings: Hangings,
}

impl Style {
    /// Walls with nothing on them.
    pub(crate) fn bare(wall: Wall, floor: FloorSurface) -> Self {
        Self { wall, floor, hangings: Hangings { choice: vec![], gap_m: (1.0, 1.0), copies: false, niche_door: None } }
    }

    /// Walls with things on them, each different.
    pub(crate) fn hung(wall: Wall, floor: FloorSurface, choice: &[Hanging], gap_m: (f64, f64)) -> Self {
        Self { wall, floor, hangings: Hangings { choice: choice.to_vec(), gap_m, copies: false, niche_door: None } }
    }

    /// Makes all things of one kind copies of one drawing.
    pub(crate) fn repeating(mut self) -> Self {
        self.hangings.copies = true;
        self
    }

    /// Puts doors into niches.
    pub(crate) fn with_doors(mut self, colour: Rgb) -> Self {
        self.hangings.niche_door = Some(colour);
        self
    }
}
