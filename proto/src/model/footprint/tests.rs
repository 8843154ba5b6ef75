//! What follows from a footprint, and which are refused.

use super::*;
use proptest::prelude::*;

#[test]
fn the_default_is_the_papers_robot_and_its_clearances_are_the_numbers_that_one_would_write() {
    let it = Footprint::default();
    assert_eq!(it.circumscribed_radius_m().to_bits(), 0.105_f64.to_bits());
    let metres = [
        (it.edge_clearance_m(), 0.165),
        (it.mesh_clearance_m(), 0.16),
        (it.grid_clearance_m(), 0.15),
        (it.comfort_clearance_m(), 0.35),
        (it.squeeze_clearance_m(), 0.12),
        (it.stop_margin_m(), 0.03),
    ];
    assert!(metres.iter().all(|(is, should)| is.to_bits() == f64::to_bits(*should)), "{metres:?}");
    let whole = (it.edge_clearance_mm(), it.mesh_clearance_mm(), it.sure_clearance_mm(), it.grid_clearance_mm());
    assert_eq!(whole, (165, 160, 130, 150));
    assert_eq!((it.entry_clearances_mm(), it.edge_thing_mm(), it.body_mm()), ([115, 95], 110, 112));
    assert_eq!((it.planned_as(), it.validate()), (it, Ok(())));
}

#[test]
fn what_is_no_footprint_is_refused() {
    for bad in ["", "x", "0", "-0.3", "NaN", "inf", "2.1", "0.3,0.2", "1,0_0,1", "0.1,0_0.2,0_0.1,0.1"] {
        assert!(bad.parse::<Footprint>().is_err(), "{bad}");
    }
    // A pentagram turns in one sense at each corner, and winds twice.
    let star = (0..5).map(|k| (f64::from(k) * 0.8 * std::f64::consts::PI).sin_cos());
    assert!(Footprint::polygon(star.map(|(y, x)| [x, y]).collect()).is_err());
    let bent = vec![[0.4, 0.4], [-0.4, 0.4], [-0.4, -0.4], [0.4, -0.4], [0.1, 0.0]];
    assert!(Footprint::polygon(bent).is_err());
    assert!(Footprint { margin_m: f64::NAN, ..Footprint::default() }.validate().is_err());
    assert!(Footprint { margin_m: 0.6, ..Footprint::default() }.validate().is_err());
}

#[test]
fn it_is_written_in_json_with_or_without_a_margin() -> Result<(), serde_json::Error> {
    let disc: Footprint = serde_json::from_str(r#"{"shape":{"radius":0.3}}"#)?;
    assert_eq!(Ok(disc), Footprint::disc(0.3));
    let square: Footprint =
        serde_json::from_str(r#"{"shape":{"polygon":[[0.2,0.2],[-0.2,0.2],[-0.2,-0.2],[0.2,-0.2]]},"margin_m":0.05}"#)?;
    assert_eq!((square.margin_m, square.validate()), (0.05, Ok(())));
    assert!(serde_json::from_str::<Footprint>(r#"{"shape":{"radius":0.3},"margin":0.1}"#).is_err());
    Ok(())
}

fn regular(corners: u32, radius_m: f64, turned: f64) -> Vec<[f64; 2]> {
    let angle = |k| turned + f64::from(k) * std::f64::consts::TAU / f64::from(corners);
    (0..corners).map(|k| [radius_m * angle(k).cos(), radius_m * angle(k).sin()]).collect()
}

proptest! {
    #[test]
    fn a_polygon_lies_between_its_two_discs(corners in 3_u32..=32, radius_m in 0.02_f64..1.9, turned in 0.0_f64..7.0, is_reversed: bool) {
        let mut polygon = regular(corners, radius_m, turned);
        if is_reversed {
            polygon.reverse();
        }
        let footprint = Footprint::polygon(polygon).map_err(|error| TestCaseError::fail(error.to_string()))?;
        let inscribed_m = radius_m * (std::f64::consts::PI / f64::from(corners)).cos();
        prop_assert!((footprint.circumscribed_radius_m() - radius_m).abs() < 1e-9);
        prop_assert!((footprint.inscribed_radius_m() - inscribed_m).abs() < 1e-9);
        prop_assert_eq!(footprint.to_string().parse::<Footprint>(), Ok(footprint));
    }

    #[test]
    fn paths_are_planned_for_one_that_needs_no_less_room(radius_m in 0.01_f64..=2.0, margin_m in 0.0_f64..=0.5) {
        let footprint = Footprint { shape: FootprintShape::Radius(radius_m), margin_m };
        prop_assert!(footprint.validate().is_ok());
        let planned = footprint.planned_as();
        prop_assert!(planned.mesh_clearance_mm() >= footprint.mesh_clearance_mm());
        prop_assert_eq!(planned.planned_as(), planned.clone());
        if footprint.is_larger_than_explorers() {
            prop_assert!(planned.mesh_clearance_mm() < footprint.mesh_clearance_mm() + 10);
            prop_assert_eq!(planned.radius_mm() % 10, 0);
        } else {
            prop_assert_eq!(planned, Footprint::default());
        }
    }
}
