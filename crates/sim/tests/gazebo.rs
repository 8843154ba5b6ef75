//! Gazebo worlds written by the tests themselves: good ones, and flawed ones that load all the
//! same.

#![allow(clippy::unwrap_used, reason = "helpers of tests, where a panic is the failure")]

use fht_perception::frame::Panorama;
use fht_perception::pose::{Pose2, pose};
use fht_sim::{SimConfig, Simulator, World, WorldError, load};
use image::{Rgb, RgbImage};
use proptest::prelude::*;
use std::path::Path;
use std::sync::Arc;
use tempfile::TempDir;

/// A room of 8 m × 6 m, inner size, around the origin, of four boxes.
const ROOM: &str = r#"
    <model name="room"><static>true</static><link name="walls">
      <visual name="east"><pose>4.1 0 1 0 0 0</pose><geometry><box><size>0.2 6.4 2</size></box></geometry>
        <material><ambient>1 0 0 1</ambient><diffuse>1 0 0 1</diffuse></material></visual>
      <visual name="west"><pose>-4.1 0 1 0 0 0</pose><geometry><box><size>0.2 6.4 2</size></box></geometry>
        <material><script><name>Gazebo/Blue</name></script></material></visual>
      <visual name="north"><pose>0 3.1 1 0 0 0</pose><geometry><box><size>8.4 0.2 2</size></box></geometry></visual>
      <visual name="south"><pose>0 -3.1 1 0 0 0</pose><geometry><box><size>8.4 0.2 2</size></box></geometry></visual>
    </link></model>"#;

/// The room with something in it.
fn room_with(content: &str) -> String {
    format!(
        r#"<?xml version="1.0"?><sdf version="1.7"><world name="w">
        <include><uri>model://sun</uri></include><include><uri>model://ground_plane</uri></include>{ROOM}{content}
        </world></sdf>"#
    )
}

fn write(folder: &TempDir, path: &str, content: impl AsRef<[u8]>) {
    let path = folder.path().join(path);
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    std::fs::write(path, content).unwrap();
}

fn load_text(text: &str) -> Result<World, WorldError> {
    let folder = tempfile::tempdir().unwrap();
    load_in(&folder, text)
}

fn load_in(folder: &TempDir, text: &str) -> Result<World, WorldError> {
    write(folder, "worlds/room.world", text);
    load(&folder.path().join("worlds/room.world").to_string_lossy(), None, 1)
}

fn exact() -> SimConfig {
    SimConfig { lidar_noise_m: 0.0, lidar_mount_m: [0.0, 0.0, 0.182], camera_noise_levels: 0.0, ..SimConfig::default() }
}

/// Ranges ahead, to the left, behind and to the right.
fn ranges(world: World, at: Pose2) -> [f64; 4] {
    let config = SimConfig { lidar_range_max_m: 30.0, camera_every: 0, ..exact() };
    let scan = Simulator::new(Arc::new(world), config, at, 1).sense_first().scan;
    [0, 90, 180, 270].map(|beam| f64::from(scan.ranges_m[beam]))
}

fn panorama(world: World, at: Pose2) -> Panorama {
    Simulator::new(Arc::new(world), SimConfig { view_pixels: 160, ..exact() }, at, 1).sense_first().panorama.unwrap()
}

fn assert_near(ranges: [f64; 4], expected: [f64; 4]) {
    for (range, expected) in ranges.iter().zip(expected) {
        assert!((range - expected).abs() < 1e-4, "{ranges:?} against {expected:?}");
    }
}

/// Which of the primary colours a pixel shows most.
fn hue(pixel: Rgb<u8>) -> char {
    let [red, green, blue] = pixel.0.map(i32::from);
    match (red > 90, green > 90, blue > 90) {
        (true, true, false) => 'y',
        (true, false, false) => 'r',
        (false, true, false) => 'g',
        (false, false, true) => 'b',
        _ => '?',
    }
}

#[test]
fn boxes_are_where_they_should_be() {
    let world = load_text(&room_with("")).unwrap();
    assert_eq!(world.name(), "room");
    assert_eq!(world.triangle_count(), 48);
    assert!(world.warnings().is_empty(), "{:?}", world.warnings());
    assert!((world.plan().free_area_m2() - 48.0).abs() < 2.0, "{}", world.plan().free_area_m2());
    assert!(world.start().translation.vector.norm() < 0.05, "the origin is free");
    let panorama = panorama(load_text(&room_with("")).unwrap(), Pose2::identity());
    assert_eq!(hue(*panorama.views[0].get_pixel(80, 80)), 'r', "red in the east");
    assert_eq!(hue(*panorama.views[2].get_pixel(80, 80)), 'b', "blue in the west");
    assert_near(ranges(world, pose(1.0, 0.5, 0.0)), [3.0, 2.5, 5.0, 3.5]);
}

#[test]
fn the_bumper_and_the_plan_agree() {
    let world = Arc::new(load_text(&room_with("")).unwrap());
    let mut simulator = Simulator::new(Arc::clone(&world), exact(), Pose2::identity(), 1);
    for _ in 0..100 {
        simulator.step(fht_perception::frame::Twist { linear_mps: 0.5, angular_radps: 0.0 });
    }
    let stopped = simulator.truth().translation.x;
    assert!((stopped - (4.0 - 0.105)).abs() < 2e-3, "{stopped}");
    assert!(simulator.collisions() > 0);
    assert!(!world.plan().is_occupied(3.9, 0.0) && world.plan().is_occupied(4.06, 0.0));
}

#[test]
fn what_can_be_run_into_is_seen_and_tables_are_not() {
    // A step that ends just below the scanner's mount, a table top, and a mat.
    let things = r#"<model name="things"><link name="l">
        <visual name="step"><pose>2.5 0 0.085 0 0 0</pose><geometry><box><size>1 1 0.17</size></box></geometry></visual>
        <visual name="table"><pose>-2 0 0.7 0 0 0</pose><geometry><box><size>1 1 0.05</size></box></geometry></visual>
        <visual name="mat"><pose>0 2 0.01 0 0 0</pose><geometry><box><size>1 1 0.02</size></box></geometry></visual>
        </link></model>"#;
    let world = load_text(&room_with(things)).unwrap();
    let plan = world.plan();
    assert!(plan.is_occupied(2.05, 0.0) && !plan.is_occupied(-2.0, 0.0) && !plan.is_occupied(0.0, 2.0));
    assert_near(ranges(world, Pose2::identity()), [2.0, 3.0, 4.0, 3.0]);
}

#[test]
fn poses_of_models_links_and_visuals_add_up() {
    // A thin box, turned by 90° in all, so that its long side runs along y; state and nested
    // models move it.
    let thing = r#"<model name="outer"><pose>9 9 0 0 0 0</pose>
        <model name="inner"><pose>1 0 0 0 0 0.785398163397</pose><link name="l"><pose>0 0 0 0 0 0.785398163397</pose>
          <visual name="v"><pose>0 -1 0.5 0 0 0</pose><geometry><box><size>1 0.1 1</size></box></geometry></visual>
        </link></model></model>
        <state world_name="w"><model name="outer"><pose>1 0 0 0 0 0</pose></model></state>"#;
    // The visual stands at outer (1, 0) + inner (1, 0) + its own (0, -1) turned by 90°: (3, 0).
    assert_near(ranges(load_text(&room_with(thing)).unwrap(), Pose2::identity()), [2.95, 3.0, 4.0, 3.0]);
}

#[test]
fn frames_are_followed() {
    let thing = r#"<model name="m"><frame name="f" attached_to="l"><pose>1 0 0 0 0 0</pose></frame>
        <link name="l"><pose>0.5 0 0 0 0 0</pose><visual name="v"><pose relative_to="f">1 0 0.5 0 0 0</pose>
        <geometry><cylinder><radius>0.5</radius><length>1</length></cylinder></geometry></visual></link></model>
        <model name="lost"><pose relative_to="nowhere">0 2 0 0 0 0</pose><link name="l"><visual name="v">
        <geometry><sphere><radius>0.5</radius></sphere></geometry></visual></link></model>
        <model name="chase"><frame name="a"><pose relative_to="b"/></frame><frame name="b"><pose relative_to="a"/></frame>
        <link name="l"><pose relative_to="a">-3 0 0 0 0 0</pose></link></model>"#;
    let world = load_text(&room_with(thing)).unwrap();
    assert!(world.warnings()[0].contains("nowhere"), "{:?}", world.warnings());
    let [ahead, left, ..] = ranges(world, Pose2::identity());
    assert!((ahead - 2.0).abs() < 0.01, "{ahead}");
    assert!((left - (2.0 - (0.25_f64 - 0.182 * 0.182).sqrt())).abs() < 0.02, "{left}");
}

/// A picture whose quarters are red, green (above), blue and yellow (below).
fn quarters() -> RgbImage {
    RgbImage::from_fn(64, 64, |x, y| match (x < 32, y < 32) {
        (true, true) => Rgb([220, 0, 0]),
        (false, true) => Rgb([0, 200, 0]),
        (true, false) => Rgb([0, 0, 220]),
        (false, false) => Rgb([220, 200, 0]),
    })
}

/// The hues that a picture hung 2 m ahead shows: upper left and right, lower left and right.
fn seen(world: World) -> String {
    let view = &panorama(world, Pose2::identity()).views[0];
    [(60, 60), (100, 60), (60, 100), (100, 100)].iter().map(|&(x, y)| hue(*view.get_pixel(x, y))).collect()
}

/// An upright square of 2 m whose middle is at (2, 0, 1.01), seen from the origin.
const PANEL_OBJ: &str = "mtllib panel.mtl\nv 0 1 0\nv 0 -1 0\nv 0 -1 2\nv 0 1 2\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl paint\n\
                         f 1/1 2/2 3/3 4/4\n";

fn panel(mesh: &str, more: &str) -> (TempDir, String) {
    let folder = tempfile::tempdir().unwrap();
    let model = format!(
        r#"<sdf version="1.6"><model name="panel"><link name="l"><visual name="v"><pose>0 0 0.01 0 0 0</pose>
        <geometry><mesh><uri>model://panel/meshes/{mesh}</uri>{more}</mesh></geometry></visual></link></model></sdf>"#
    );
    write(&folder, "models/panel/model.sdf", model);
    let picture = folder.path().join("models/panel/materials/textures/quarters.png");
    std::fs::create_dir_all(picture.parent().unwrap()).unwrap();
    quarters().save(picture).unwrap();
    let world = room_with("<include><uri>model://panel</uri><name>p</name><pose>2 0 0 0 0 0</pose></include>");
    (folder, world)
}

#[test]
fn pictures_on_meshes_are_upright_and_not_mirrored() {
    let (folder, world) = panel("panel.obj", "");
    write(&folder, "models/panel/meshes/panel.obj", PANEL_OBJ);
    write(&folder, "models/panel/meshes/panel.mtl", "newmtl paint\nKd 1 1 1\nmap_Kd quarters.png\n");
    let world = load_in(&folder, &world).unwrap();
    assert!(world.warnings().is_empty(), "{:?}", world.warnings());
    assert_eq!(world.triangle_count(), 50);
    assert_eq!(seen(world), "rgby");
}

/// A COLLADA file of the same panel in centimetres.
fn panel_dae(up: &str, transform: &str) -> String {
    format!(
        r##"<?xml version="1.0"?><COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
        <asset><unit meter="0.01" name="centimeter"/><up_axis>{up}</up_axis></asset>
        <library_images><image id="i"><init_from>../../gone/quarters.png</init_from></image></library_images>
        <library_effects><effect id="e"><profile_COMMON>
          <newparam sid="s"><surface type="2D"><init_from>i</init_from></surface></newparam>
          <newparam sid="p"><sampler2D><source>s</source></sampler2D></newparam>
          <technique sid="t"><lambert><diffuse><texture texture="p" texcoord="UV"/></diffuse></lambert></technique>
        </profile_COMMON></effect></library_effects>
        <library_materials><material id="m"><instance_effect url="#e"/></material></library_materials>
        <library_geometries><geometry id="g" name="board"><mesh>
          <source id="pos"><float_array id="pa" count="12">0 100 0 0 -100 0 0 -100 200 0 100 200</float_array>
            <technique_common><accessor source="#pa" count="4" stride="3"/></technique_common></source>
          <source id="uv"><float_array id="ua" count="8">0 0 1 0 1 1 0 1</float_array>
            <technique_common><accessor source="#ua" count="4" stride="2"/></technique_common></source>
          <vertices id="v"><input semantic="POSITION" source="#pos"/></vertices>
          <triangles count="2" material="sym"><input semantic="VERTEX" offset="0" source="#v"/>
            <input semantic="TEXCOORD" offset="1" source="#uv"/><p>0 0 1 1 2 2 0 0 2 2 3 3</p></triangles>
        </mesh></geometry></library_geometries>
        <library_visual_scenes><visual_scene id="vs"><node id="n">{transform}<instance_geometry url="#g">
          <bind_material><technique_common><instance_material symbol="sym" target="#m"/></technique_common></bind_material>
        </instance_geometry></node></visual_scene></library_visual_scenes>
        <scene><instance_visual_scene url="#vs"/></scene></COLLADA>"##
    )
}

#[test]
fn collada_is_scaled_to_metres_and_keeps_its_axes() {
    for (up, transform) in
        [("Z_UP", ""), ("Y_UP", ""), ("Y_UP", "<rotate>0 0 1 180</rotate><rotate>0 0 1 -180</rotate>")]
    {
        let (folder, world) = panel("panel.dae", "");
        write(&folder, "models/panel/meshes/panel.dae", panel_dae(up, transform));
        let loaded = load_in(&folder, &world).unwrap();
        assert!(loaded.warnings().is_empty(), "{:?}", loaded.warnings());
        assert_eq!(seen(loaded), "rgby");
        assert_near(ranges(load_in(&folder, &world).unwrap(), Pose2::identity()), [2.0, 3.0, 4.0, 3.0]);
    }
}

#[test]
fn parts_of_a_mesh_can_be_named() {
    for (name, flaws) in [("board", 0), ("other", 1)] {
        let (folder, world) = panel("panel.dae", &format!("<submesh><name>{name}</name></submesh>"));
        write(&folder, "models/panel/meshes/panel.dae", panel_dae("Z_UP", ""));
        let world = load_in(&folder, &world).unwrap();
        assert_eq!((world.triangle_count(), world.warnings().len()), (50 - 2 * flaws, flaws));
    }
}

#[test]
fn a_centred_part_is_moved_to_the_origin() {
    let (folder, world) = panel("panel.dae", "<submesh><name>board</name><center>true</center></submesh>");
    write(&folder, "models/panel/meshes/panel.dae", panel_dae("Z_UP", ""));
    // The panel is a metre lower: its upper half is where the lower one was.
    assert_eq!(seen(load_in(&folder, &world).unwrap())[2..], *"rg");
}

#[test]
fn stl_meshes_are_scaled() {
    let (folder, world) = panel("panel.stl", "<scale>0.001 0.001 0.001</scale>");
    let stl = "solid panel\nfacet normal 0 0 0\nouter loop\nvertex 500 5000 0\nvertex 500 -5000 0\nvertex 500 0 2000\n\
               endloop\nendfacet\nendsolid\n";
    write(&folder, "models/panel/meshes/panel.stl", stl);
    assert_near(ranges(load_in(&folder, &world).unwrap(), Pose2::identity()), [2.5, 3.0, 4.0, 3.0]);
}

#[test]
fn what_is_missing_is_told_and_the_rest_is_loaded() {
    let (folder, _) = panel("panel.obj", "");
    write(&folder, "models/panel/meshes/panel.obj", PANEL_OBJ.replace("panel.mtl", "none.mtl"));
    write(&folder, "models/bad/model.sdf", "<sdf><model name='x'><link>");
    write(
        &folder,
        "models/round/model.sdf",
        "<sdf><model name='r'><include><uri>model://round</uri></include></model></sdf>",
    );
    let world = room_with(
        r#"<include><uri>model://panel</uri><pose>2 0 -7.57769e+08 0 0 0</pose></include>
        <include><uri>model://unheard_of</uri></include><include><uri>model://bad</uri></include>
        <include><uri>model://round</uri></include>
        <model name="m"><link name="l">
          <visual name="a"><geometry><mesh><uri>model://panel/meshes/gone.dae</uri></mesh></geometry></visual>
          <visual name="b"><geometry><heightmap><uri>hills.png</uri></heightmap></geometry></visual>
          <visual name="c"><geometry><box><size>1 -1 nan</size></box></geometry></visual>
          <visual name="d"><geometry><sphere><radius>1e300</radius></sphere></geometry></visual>
          <visual name="e"><pose>-3 0 0.5 0 0 0</pose><geometry><box><size>1 1 1</size></box></geometry>
            <material><script><name>Vendor/Velvet</name></script></material></visual>
          <visual name="f"><pose>0 2 0.5 0 0 0</pose><geometry><box><size>1 1 1</size></box></geometry>
            <material><pbr><metal><albedo_map>gone.png</albedo_map></metal></pbr></material></visual>
        </link></model>"#,
    );
    let world = load_in(&folder, &world).unwrap();
    let told = world.warnings().join("\n");
    for flaw in [
        "unheard_of",
        "model://bad",
        "model://round",
        "-7.57769e+08",
        "gone.dae (missing)",
        "heightmap of m",
        "box of m",
        "sphere of m",
        "Vendor/Velvet",
        "gone.png (missing)",
    ] {
        assert!(told.contains(flaw), "{flaw} is not told of:\n{told}");
    }
    assert_near(ranges(world, Pose2::identity()), [2.0, 1.5, 2.5, 3.0]);
}

#[test]
fn open_country_is_fenced() {
    let world = r#"<sdf version="1.6"><world name="w"><include><uri>model://ground_plane</uri></include>
        <model name="box"><pose>3 0 0.5 0 0 0</pose><link name="l"><visual name="v"><geometry><box><size>1 1 1</size></box>
        </geometry></visual></link></model></world></sdf>"#;
    let world = load_text(world).unwrap();
    assert!(world.warnings()[0].contains("fence"), "{:?}", world.warnings());
    let [ahead, _, behind, _] = ranges(world, Pose2::identity());
    assert!((ahead - 2.5).abs() < 1e-4 && (behind - 0.95).abs() < 1e-4, "{ahead} {behind}");
}

#[test]
fn what_is_no_world_is_an_error() {
    let message = |text: &str| load_text(text).err().map(|error| error.to_string()).unwrap_or_default();
    assert!(message("<sdf><world>").contains("malformed XML"), "{}", message("<sdf><world>"));
    assert!(message("<html/>").contains("html"));
    assert!(message("<sdf version='1.6'><world name='w'/></sdf>").contains("has no"));
    let remote = room_with("<model name='far'><pose>500000 5400000 0 0 0 0</pose></model>");
    let remote = message(&remote);
    assert!(remote.contains("over 100 km") && remote.contains("far at 500000 5400000"), "{remote}");
    let nothing =
        message("<sdf version='1.6'><world name='w'><include><uri>model://nope</uri></include></world></sdf>");
    for part in ["model://nope", "models", "GAZEBO_MODEL_PATH"] {
        assert!(nothing.contains(part), "{nothing} does not say {part}");
    }
    let missing = load("nowhere/none.world", None, 1).err().map(|error| error.to_string()).unwrap_or_default();
    assert!(missing.contains("none.world"), "{missing}");
}

#[test]
fn deep_and_wide_files_end_in_words() {
    let deep = format!("<sdf><world name='w'>{}", "<model name='m'>".repeat(200_000));
    assert!(load_text(&deep).is_err());
    let closed = format!("<model name='m'>{}{}</model>", "<model name='m'>".repeat(500), "</model>".repeat(500));
    assert!(load_text(&room_with(&closed)).unwrap().warnings()[0].contains("too deep"));
    // Each model includes the next ten times.
    let folder = tempfile::tempdir().unwrap();
    for level in 0..9 {
        let include = format!("<include><uri>model://m{}</uri></include>", level + 1).repeat(10);
        write(&folder, &format!("models/m{level}/model.sdf"), format!("<sdf><model name='m'>{include}</model></sdf>"));
    }
    let world = load_in(&folder, &room_with("<include><uri>model://m0</uri></include>")).unwrap();
    assert!(world.warnings().iter().any(|told| told.contains("models and visuals after")), "{:?}", world.warnings());
}

/// Changes some bytes of a file.
fn mutated(text: &str, changes: &[(prop::sample::Index, u8, bool)]) -> Vec<u8> {
    let mut bytes = text.as_bytes().to_vec();
    for (index, byte, replaces) in changes {
        let at = index.index(bytes.len());
        if *replaces { bytes[at] = *byte } else { bytes.insert(at, *byte) }
    }
    bytes
}

fn load_mutated(path: &str, content: &[u8]) {
    let mesh = Path::new(path).file_name().unwrap().to_string_lossy().into_owned();
    let (folder, world) = panel(&mesh, "");
    write(&folder, "models/panel/meshes/panel.obj", PANEL_OBJ);
    write(&folder, "models/panel/meshes/panel.mtl", "newmtl paint\nKd 1 1 1\nmap_Kd quarters.png\n");
    write(&folder, path, content);
    drop(load_in(&folder, &world));
}

fn changes() -> impl Strategy<Value = Vec<(prop::sample::Index, u8, bool)>> {
    // Digits and signs do more damage than letters.
    let byte = prop_oneof![Just(b'9'), Just(b'-'), Just(b'e'), Just(b'<'), Just(b' '), any::<u8>()];
    prop::collection::vec((any::<prop::sample::Index>(), byte, any::<bool>()), 1..8)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn mutated_meshes_never_panic(changes in changes(), which in 0..4) {
        let stl = "solid panel\nfacet normal 0 0 0\nouter loop\nvertex 5 5 0\nvertex 5 -5 0\nvertex 5 0 2\n";
        let dae = panel_dae("Z_UP", "<matrix>1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1</matrix>");
        let (path, text) = match which {
            0 => ("models/panel/meshes/panel.obj", PANEL_OBJ),
            1 => ("models/panel/meshes/panel.dae", dae.as_str()),
            2 => ("models/panel/meshes/panel.stl", stl),
            _ => ("models/panel/meshes/panel.mtl", "newmtl paint\nKd 1 1 1\nmap_Kd quarters.png\n"),
        };
        load_mutated(path, &mutated(text, &changes));
    }

    #[test]
    fn mutated_worlds_never_panic(changes in changes()) {
        let folder = tempfile::tempdir().unwrap();
        write(&folder, "worlds/room.world", mutated(&room_with(""), &changes));
        drop(load(&folder.path().join("worlds/room.world").to_string_lossy(), None, 1));
    }
}
