//! What the paper prints (tables II and III).

use crate::systems::System;

/// Mean and standard deviation, or mean and greatest.
pub type Two = [f64; 2];

/// One column of a table, for one scene.
#[derive(Clone, Copy, Debug)]
pub struct Printed {
    /// KB.
    pub storage_kb: f64,
    /// Percent; the second table has none.
    pub success: Option<f64>,
    /// Metres, mean and deviation.
    pub l_reloca: Two,
    /// Percent, mean and deviation.
    pub epsilon_t: Two,
    /// Degrees, mean and deviation.
    pub epsilon_theta: Two,
    /// Mean and greatest.
    pub c_path: Two,
}

const fn column(
    storage_kb: f64,
    success: Option<f64>,
    l_reloca: Two,
    epsilon_t: Two,
    epsilon_theta: Two,
    c_path: Two,
) -> Printed {
    Printed { storage_kb, success, l_reloca, epsilon_t, epsilon_theta, c_path }
}

const MUSEUM: [Printed; 3] = [
    column(60.10, Some(100.0), [5.01, 3.55], [0.541, 0.311], [0.231, 0.225], [1.08, 1.18]),
    column(64.52, Some(100.0), [12.44, 6.82], [4.16, 1.85], [1.49, 0.64], [1.26, 1.70]),
    column(189.79, Some(87.5), [14.27, 13.73], [1.53, 0.555], [0.800, 0.377], [1.0, 1.0]),
];
const OFFICE: [Printed; 3] = [
    column(278.93, Some(100.0), [5.47, 4.04], [0.751, 0.341], [0.428, 0.214], [1.07, 1.24]),
    column(258.02, Some(100.0), [16.41, 6.73], [2.73, 1.85], [0.760, 0.853], [4.76, 14.56]),
    column(1243.05, Some(25.0), [8.80, 1.93], [4.52, 3.86], [0.705, 0.344], [1.0, 1.0]),
];
const MUSEUM_ABLATION: [Printed; 2] = [
    column(94.72, None, [5.91, 4.42], [0.511, 0.362], [0.30, 0.17], [1.18, 1.48]),
    column(60.10, None, [5.01, 3.55], [0.541, 0.311], [0.23, 0.22], [1.08, 1.18]),
];
const OFFICE_ABLATION: [Printed; 2] = [
    column(154.88, None, [14.29, 8.58], [0.678, 0.621], [0.439, 0.191], [2.72, 8.42]),
    column(110.51, None, [14.60, 16.60], [0.665, 0.220], [0.634, 0.707], [1.04, 1.12]),
];

/// The scene that a world is in the paper.
pub fn scene(world: &str) -> Option<&'static str> {
    match world {
        "museum" => Some("Museum"),
        "large_indoor" => Some("Office"),
        _ => None,
    }
}

/// Table II: comparison with other maps.
pub fn comparison(world: &str, system: System) -> Option<Printed> {
    let columns = match scene(world)? {
        "Museum" => &MUSEUM,
        _ => &OFFICE,
    };
    match system {
        System::Ours => Some(columns[0]),
        System::MrTopomap => Some(columns[1]),
        System::Amcl => Some(columns[2]),
        _ => None,
    }
}

/// Table III: the hierarchical architecture. In the office both maps have sigma_c = 5 m there.
pub fn ablation(world: &str, system: System) -> Option<Printed> {
    let columns = match scene(world)? {
        "Museum" => &MUSEUM_ABLATION,
        _ => &OFFICE_ABLATION,
    };
    match system {
        System::MainOnly => Some(columns[0]),
        System::Ours => Some(columns[1]),
        _ => None,
    }
}
