//! Maps as pictures (PNG), in the map frame: x to the right, y up. Around what is drawn stand axes
//! in metres, a scale bar, the directions of x and y, and a legend of what is in the picture.
//!
//! | module | idea |
//! | --- | --- |
//! | `map` | an FHT-Map on its floor, like the paper's figure 1: [`MapPicture`] |
//! | `plot` | drawing in metres, without seams between what abuts: [`Plot`] |
//! | `sheet` | what stands around a plot: [`Sheet`] |
//! | `file` | where pictures go: [`default_file`] |
//! | `letters` | text in a bitmap font |
//! | `round` | lengths that people like: 1, 2, 5, 10, … |
//!
//! ```
//! use fht_map::MapState;
//! use fht_perception::grid::{GridConfig, OccupancyGrid};
//! use fht_perception::pose::Point2;
//! use fht_picture::{Mark, MapPicture, PictureConfig, default_file};
//!
//! # let folder = tempfile::tempdir()?;
//! let picture = MapPicture {
//!     title: "explore: museum, seed 1".to_owned(),
//!     floor: &OccupancyGrid::new(GridConfig::default()),
//!     map: &MapState::new(),
//!     driven: &[Point2::new(0.0, 0.0), Point2::new(3.0, 1.0)],
//!     marks: &[(Mark::Start, Point2::new(0.0, 0.0))],
//! };
//! let file = folder.path().join(default_file("explore", "museum", Some(1)));
//! picture.save(&PictureConfig::default(), &file)?;
//! assert!(file.ends_with("explore-museum-1.png") && file.exists());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod file;
mod letters;
mod map;
mod plot;
mod round;
mod sheet;

pub use file::{PictureError, default_file};
pub use map::{Floor, MapPicture, Mark};
pub use plot::{Extent, PictureConfig, Plot, Rgb};
pub use sheet::{LegendEntry, Sheet, Swatch};
