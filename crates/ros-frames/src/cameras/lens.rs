//! How a camera looks: by its `camera_info` and its transform, what it sees of a quarter of the
//! surroundings.

use super::{optical, yaw_of_camera};
use fht_ros_messages::msg::CameraInfoMsg;
use image::{Rgb, RgbImage};
use nalgebra::{UnitQuaternion, Vector3};

/// Least and greatest side of a view, pixels.
const SIDE: (u32, u32) = (32, 640);
/// Of what a panorama shows of a quarter a camera must see so much; the rest has the colour of its
/// border.
const LEAST_SEEN: f64 = 0.6;
/// Distortion that is not worth a word: the sum of the parameters.
const LITTLE_DISTORTION: f64 = 0.02;
/// A lens that is so near to the one of a panorama is taken to be that one: pixels, radians.
const ALIKE: (f64, f64) = (1.0, 0.01);

/// A pinhole camera on the robot.
#[derive(Clone, Debug, PartialEq)]
pub struct Lens {
    /// Focal lengths and middle, pixels of the picture.
    focal: [f64; 2],
    middle: [f64; 2],
    size: [u32; 2],
    base_from_camera: UnitQuaternion<f64>,
    /// Whether straight lines are not straight in its pictures.
    is_distorted: bool,
}

/// Why a camera cannot be one of the four of a panorama.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum LensRefused {
    /// The camera is not calibrated.
    #[error("its camera_info has no focal length: calibrate the camera, or leave its camera_info out")]
    Uncalibrated,
    /// The lens is not a pinhole.
    #[error("its lens is {0:?}, not a pinhole: give its rectified pictures (image_proc)")]
    NoPinhole(String),
    /// It sees too little of its quarter.
    #[error(
        "it sees {seen:.0} % of its quarter of the surroundings, {across_deg:.0}° across and {up_deg:.0}° up and down: a \
         panorama needs four cameras of about 90°, ahead, left, behind, right; see its transform, or the order of the \
         topics"
    )]
    SeesTooLittle {
        /// Of what a panorama shows of the quarter, percent.
        seen: f64,
        /// Its angle of view from left to right, degrees.
        across_deg: f64,
        /// From top to bottom, degrees.
        up_deg: f64,
    },
}

impl Lens {
    /// The lens of `info`, whose optical frame is turned so against the robot's base.
    ///
    /// # Errors
    /// [`LensRefused`].
    pub fn of(info: &CameraInfoMsg, base_from_camera: UnitQuaternion<f64>) -> Result<Self, LensRefused> {
        let [fx, _, cx, _, fy, cy, ..] = info.k;
        let is_set = |value: f64| value.is_finite() && value > 0.0;
        if ![fx, cx, fy, cy].into_iter().all(is_set) || info.width == 0 || info.height == 0 {
            return Err(LensRefused::Uncalibrated);
        }
        let model = info.distortion_model.as_str();
        if !matches!(model, "" | "plumb_bob" | "rational_polynomial") {
            return Err(LensRefused::NoPinhole(model.chars().take(40).collect()));
        }
        let is_distorted = info.d.iter().map(|parameter| parameter.abs()).sum::<f64>() > LITTLE_DISTORTION;
        let size = [info.width, info.height];
        Ok(Self { focal: [fx, fy], middle: [cx, cy], size, base_from_camera, is_distorted })
    }

    /// Whether straight lines are not straight in its pictures, which are used as they are.
    #[must_use]
    pub fn is_distorted(&self) -> bool {
        self.is_distorted
    }

    /// Whether its pictures are the view of camera `camera` of a panorama as they are.
    fn is_view(&self, camera: usize) -> bool {
        let [width, height] = self.size;
        let half = f64::from(width) / 2.0;
        let is_near = |value: f64| (value - half).abs() <= ALIKE.0;
        let turn = self.base_from_camera.angle_to(&optical(yaw_of_camera(camera)));
        width == height && self.focal.into_iter().chain(self.middle).all(is_near) && turn <= ALIKE.1
    }

    /// The side of a view with about as many pixels as a picture of it has.
    pub(super) fn side(&self, picture: &RgbImage, camera: usize) -> u32 {
        let [width, height] = self.size;
        if self.is_view(camera) && picture.dimensions() == (width, height) {
            return width;
        }
        let side = 2.0 * self.focal[0] * f64::from(picture.width()) / f64::from(width);
        (side.round().min(f64::from(SIDE.1)) as u32).max(SIDE.0)
    }

    /// What it sees of the quarter of camera `camera` (0 ahead, 1 left, 2 behind, 3 right): a view
    /// of 90° with `side` pixels.
    ///
    /// # Errors
    /// [`LensRefused::SeesTooLittle`].
    pub(super) fn view(&self, picture: &RgbImage, camera: usize, side: u32) -> Result<RgbImage, LensRefused> {
        if self.is_view(camera) && picture.dimensions() == (side, side) {
            return Ok(picture.clone());
        }
        // Drivers scale pictures, and leave camera_info as it is.
        let scale = [f64::from(picture.width()), f64::from(picture.height())];
        let scale = [0, 1].map(|axis| scale[axis] / f64::from(self.size[axis]));
        let camera_from_base = self.base_from_camera.inverse();
        let (sin, cos) = yaw_of_camera(camera).sin_cos();
        let (ahead, right) = (Vector3::new(cos, sin, 0.0), Vector3::new(sin, -cos, 0.0));
        let step = 2.0 / f64::from(side);
        let (mut shown, mut seen) = (0_u32, 0_u32);
        let view = RgbImage::from_fn(side, side, |column, row| {
            let x = (f64::from(column) + 0.5) * step - 1.0;
            let y = 1.0 - (f64::from(row) + 0.5) * step;
            let looks = camera_from_base * (ahead + right * x + Vector3::z() * y);
            let at = [looks.x, looks.y].map(|value| value / looks.z);
            let at = [0, 1].map(|axis| (self.focal[axis] * at[axis] + self.middle[axis]) * scale[axis] - 0.5);
            let is_inside = looks.z > 0.0
                && (-1.0..=f64::from(picture.width())).contains(&at[0])
                && (-1.0..=f64::from(picture.height())).contains(&at[1]);
            // A panorama is a cylinder: it shows what lies up to atan 1/√2 up and down.
            let is_shown = y.abs() <= ((1.0 + x * x) / 2.0).sqrt();
            shown += u32::from(is_shown);
            seen += u32::from(is_shown && is_inside);
            if looks.z > 0.0 { sample(picture, at) } else { Rgb([0; 3]) }
        });
        let share = f64::from(seen) / f64::from(shown.max(1));
        if share < LEAST_SEEN {
            let [across_deg, up_deg] =
                [0, 1].map(|axis| 2.0 * (f64::from(self.size[axis]) / 2.0 / self.focal[axis]).atan().to_degrees());
            return Err(LensRefused::SeesTooLittle { seen: share * 100.0, across_deg, up_deg });
        }
        Ok(view)
    }
}

/// The colour between pixel centres; beyond the border the border's.
fn sample(picture: &RgbImage, [x, y]: [f64; 2]) -> Rgb<u8> {
    let split = |at: f64, size: u32| {
        let at = at.clamp(0.0, f64::from(size.saturating_sub(1)));
        let low = at.floor();
        (low as u32, (low as u32 + 1).min(size.saturating_sub(1)), at - low)
    };
    let (left, right, to_right) = split(x, picture.width());
    let (top, bottom, to_bottom) = split(y, picture.height());
    let colours = [(left, top), (right, top), (left, bottom), (right, bottom)];
    let [a, b, c, d] = colours.map(|(x, y)| picture.get_pixel_checked(x, y).map_or([0; 3], |pixel| pixel.0));
    Rgb([0, 1, 2].map(|channel| {
        let [a, b, c, d] = [a, b, c, d].map(|colour| f64::from(colour[channel]));
        let (upper, lower) = (a + (b - a) * to_right, c + (d - c) * to_right);
        (upper + (lower - upper) * to_bottom).round() as u8
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::FRAC_PI_2;

    fn info(width: u32, height: u32, focal: f64) -> CameraInfoMsg {
        let middle = [width, height].map(|side| f64::from(side) / 2.0);
        let k = [focal, 0.0, middle[0], 0.0, focal, middle[1], 0.0, 0.0, 1.0];
        CameraInfoMsg { width, height, k, ..CameraInfoMsg::default() }
    }

    /// Red to the right, green downwards: the slope of where each pixel looks.
    fn slopes(info: &CameraInfoMsg) -> RgbImage {
        RgbImage::from_fn(info.width, info.height, |column, row| {
            let slope = |pixel: u32, middle: f64, focal: f64| (f64::from(pixel) + 0.5 - middle) / focal;
            let colour = |slope: f64| (128.0 + 80.0 * slope).round().clamp(0.0, 255.0) as u8;
            Rgb([colour(slope(column, info.k[2], info.k[0])), colour(slope(row, info.k[5], info.k[4])), 0])
        })
    }

    #[test]
    fn a_wide_camera_gives_the_view_of_its_quarter() {
        let wide = info(400, 300, 150.0);
        for camera in 0..4 {
            let lens = Lens::of(&wide, optical(yaw_of_camera(camera))).expect("a lens");
            let side = lens.side(&slopes(&wide), camera);
            let view = lens.view(&slopes(&wide), camera, side).expect("it sees its quarter");
            assert_eq!((side, view.dimensions()), (300, (300, 300)));
            // 90°: slopes from -1 to 1.
            let near = |at: (u32, u32), wanted: [u8; 2]| {
                let colour = view.get_pixel(at.0, at.1).0;
                assert!((0..2).all(|axis| colour[axis].abs_diff(wanted[axis]) <= 2), "{camera} {at:?}: {colour:?}");
            };
            near((150, 150), [128, 128]);
            near((299, 150), [207, 128]);
            near((0, 30), [48, 64]);
        }
    }

    #[test]
    fn a_camera_that_looks_elsewhere_is_put_right_or_refused() {
        let wide = info(400, 300, 150.0);
        // Turned by 5°: what it sees ahead lies beside the middle of its picture.
        let lens = Lens::of(&wide, optical(5_f64.to_radians())).expect("a lens");
        let view = lens.view(&slopes(&wide), 0, 100).expect("it sees enough");
        let turned = (128.0 + 80.0 * 5_f64.to_radians().tan()).round() as u8;
        assert!(view.get_pixel(50, 50).0[0].abs_diff(turned) <= 3, "{:?} {turned}", view.get_pixel(50, 50));
        // What looks to the left is no camera ahead, and a camera of 60° sees too little.
        let left = Lens::of(&wide, optical(FRAC_PI_2)).expect("a lens");
        assert!(matches!(left.view(&slopes(&wide), 0, 100), Err(LensRefused::SeesTooLittle { .. })));
        let narrow = info(640, 480, 550.0);
        let lens = Lens::of(&narrow, optical(0.0)).expect("a lens");
        let said = lens.view(&slopes(&narrow), 0, 100).err().map(|refusal| refusal.to_string()).unwrap_or_default();
        assert!(said.contains("60° across"), "{said}");
    }

    #[test]
    fn pictures_that_are_views_stay_as_they_are() {
        let square = info(64, 64, 32.0);
        let lens = Lens::of(&square, optical(FRAC_PI_2)).expect("a lens");
        let picture = slopes(&square);
        assert_eq!(lens.side(&picture, 1), 64);
        // What camera_info claims costs nothing.
        let vast = Lens::of(&info(u32::MAX, u32::MAX, f64::from(u32::MAX) / 2.0), optical(0.0)).expect("a lens");
        assert_eq!(vast.side(&picture, 0), 64);
        assert_eq!(lens.view(&picture, 1, 64), Ok(picture));
        for (bad, word) in [
            (CameraInfoMsg { k: [0.0; 9], ..square.clone() }, "no focal length"),
            (CameraInfoMsg { k: [f64::NAN; 9], ..square.clone() }, "no focal length"),
            (CameraInfoMsg { width: 0, ..square.clone() }, "no focal length"),
            (CameraInfoMsg { distortion_model: "equidistant".to_owned(), ..square.clone() }, "equidistant"),
        ] {
            let said = Lens::of(&bad, optical(0.0)).err().map(|refusal| refusal.to_string()).unwrap_or_default();
            assert!(said.contains(word), "{said}");
        }
        let bent = CameraInfoMsg { d: vec![-0.3, 0.1, 0.0, 0.0, 0.0], ..square };
        assert!(Lens::of(&bent, optical(0.0)).is_ok_and(|lens| lens.is_distorted()));
    }
}
