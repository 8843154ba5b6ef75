#![no_main]
//! Files of buildings. The first byte says which sort, the rest is the file. The first zero byte
//! separates a floor plan from its picture.

use fht_sim::load;
use libfuzzer_sys::fuzz_target;
use std::path::Path;

const WORLD: &str = r#"<sdf version="1.6"><world name="w">
  <model name="floor"><static>true</static><link name="l">
    <collision name="c"><pose>3 0 0.5 0 0 0</pose><geometry><box><size>0.1 6 1</size></box></geometry></collision>
    <visual name="v"><geometry><mesh><uri>MESH</uri></mesh></geometry></visual>
    <collision name="m"><geometry><mesh><uri>MESH</uri></mesh></geometry></collision>
  </link></model></world></sdf>"#;

fuzz_target!(|bytes: &[u8]| {
    let Some((sort, bytes)) = bytes.split_first() else { return };
    let folder = std::env::temp_dir().join(format!("fht-fuzz-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("the folder for temporary files can be written");
    let write = |name: &str, bytes: &[u8]| {
        let path = folder.join(name);
        std::fs::write(&path, bytes).expect("the folder for temporary files can be written");
        path
    };
    let read = |path: &Path| {
        if let Ok(world) = load(&path.to_string_lossy(), None, 1) {
            let start = world.start();
            assert!(start.translation.vector.iter().all(|value| value.is_finite()));
        }
    };
    match sort % 5 {
        0 => {
            let mut parts = bytes.splitn(2, |byte| *byte == 0);
            let yaml = write("map.yaml", parts.next().unwrap_or_default());
            write("map.pgm", parts.next().unwrap_or_default());
            read(&yaml);
        }
        1 => read(&write("room.world", bytes)),
        sort => {
            let mesh = ["mesh.dae", "mesh.obj", "mesh.stl"][usize::from(sort) - 2];
            write(mesh, bytes);
            read(&write("mesh.world", WORLD.replace("MESH", mesh).as_bytes()));
        }
    }
});
