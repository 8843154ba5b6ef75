//! dev
use fht_robot::frame::{LaserScan, SensorFrame};
use fht_robot::pose::{pose, Pose2, wrap_angle, Point2};
use mapper::slam::{Slam, SlamConfig, Anchored};
use std::time::Instant;
fn main() {
    let args: Vec<String> = std::env::args().collect();
    let text = std::fs::read_to_string(&args[1]).unwrap();
    let mut config = SlamConfig::default();
    for setting in &args[3..] {
        let (name, value) = setting.split_once('=').unwrap();
        let v: f64 = value.parse().unwrap();
        match name {
            "kf" => config.keyframe_distance_m = v,
            "kft" => config.keyframe_turn_rad = v,
            "sub" => config.submap.keyframes = v as usize,
            "sp" => config.submap.point_spacing_m = v,
            "agree" => config.closure.min_agreement = v,
            "overlap" => config.closure.min_overlap = v,
            "tries" => config.closure.tries = v as usize,
            "reach" => config.closure.reach_m = v,
            "floor" => config.closure.floor_m = v,
            "floorr" => config.closure.floor_rad = v,
            "sigma" => { config.matching.point_sigma_m = v; config.closure.matching.point_sigma_m = v }
            "first" => config.matching.first_reach_m = v,
            "last" => { config.matching.last_reach_m = v; config.closure.matching.last_reach_m = v }
            "range" => config.grid.max_range_m = v,
            "search" => config.closure.search_every = v as usize,
            "minscore" => config.min_score = v,
            "doubt" => config.closure.graph.doubt_chi2 = v,
            "agreeing" => config.closure.agreeing = v as usize,
            "ofm" => config.odometry.floor_m = v,
            "ofr" => config.odometry.floor_rad = v,
            "normal" => { config.matching.normal_sigma_rad = v; config.closure.matching.normal_sigma_rad = v }
            "trust" => config.odometry_trust = v,
            "winm" => config.closure.window_per_m = v,
            "scale" => config.odometry.scale_sigma = v,
            "dist" => config.odometry.distance_sigma_per_m = v,
            "head" => config.odometry.heading_sigma_per_sqrt_m = v,
            "turn" => config.odometry.turn_sigma_per_rad = v,
            _ => panic!("{name}"),
        }
    }
    let begin = Instant::now();
    let mut slam = Slam::new(config);
    let mut trajectory: Vec<(u64, Anchored)> = Vec::new();
    let mut scores = Vec::new();
    for line in text.lines() {
        let v: Vec<f64> = line.split(' ').map(|x| x.parse().unwrap()).collect();
        let frame = SensorFrame { time_us: v[0] as u64, odom_from_base: pose(v[1], v[2], v[3]), panorama: None,
            scan: LaserScan { base_from_sensor: Pose2::identity(), angle_min: v[5], angle_increment: v[6], range_min_m: v[7], range_max_m: v[8], ranges_m: v[9..].iter().map(|&x| x as f32).collect() } };
        let update = slam.update(&frame);
        trajectory.push((frame.time_us, update.anchored));
        if update.score < 0.6 && std::env::var("TRACE").is_ok() { let o = frame.odom_from_base; println!("{:.3} score {:.2} points {} odom {:.3} {:.3} {:.3} at {:?}", frame.time_us as f64*1e-6, update.score, frame.scan.points_in_base().len(), o.translation.x, o.translation.y, o.rotation.angle(), update.map_from_base.translation.vector); }
        scores.push(update.score);
    }
    let online = begin.elapsed().as_secs_f64();
    let evaluate = |slam: &Slam| {
        let poses: Vec<(u64, Pose2)> = trajectory.iter().map(|(t, a)| (*t, slam.locate(a))).collect();
        if let Ok(relations) = std::fs::read_to_string(&args[2]) {
            let at = |t: f64| { let us = (t * 1e6).round() as i64; let i = poses.partition_point(|p| (p.0 as i64) < us);
                let best = [i.wrapping_sub(1), i].into_iter().filter(|&i| i < poses.len()).min_by_key(|&i| (poses[i].0 as i64 - us).abs()).unwrap();
                ((poses[best].0 as i64 - us).abs(), poses[best].1) };
            let (mut e, mut r, mut far) = (vec![], vec![], 0);
            for line in relations.lines() {
                let v: Vec<f64> = line.split_whitespace().map(|x| x.parse().unwrap()).collect();
                let (a, b) = (at(v[0]), at(v[1]));
                if a.0 > 1000 || b.0 > 1000 { far += 1; }
                let seen = a.1.inverse() * b.1;
                let want = pose(v[2], v[3], v[7]);
                if std::env::var("WORST").is_ok() && (seen.translation.vector - want.translation.vector).norm() > 0.25 { println!("worst {:.2} {:.2} off {:?}", v[0], v[1], (seen.translation.vector - want.translation.vector)); }
                e.push((seen.translation.vector - want.translation.vector).norm());
                r.push(wrap_angle(seen.rotation.angle() - want.rotation.angle()).abs().to_degrees());
            }
            let stat = |x: &[f64]| { let m = x.iter().sum::<f64>() / x.len() as f64; let s = (x.iter().map(|v| (v - m).powi(2)).sum::<f64>() / x.len() as f64).sqrt(); let mut y = x.to_vec(); y.sort_by(f64::total_cmp); (m, s, y[y.len()/2], y[y.len()*99/100], y[y.len()-1]) };
            println!("   trans {:.4?} rot {:.3?} n {} far {}", stat(&e), stat(&r), e.len(), far);
        }
    };
    let failed = scores.iter().filter(|s| **s == 0.0).count();
    println!("online {:.1} s, {} frames, {} keyframes, failed {} mean score {:.3} {:?}", online, scores.len(), slam.keyframes().len(), failed, scores.iter().sum::<f64>()/scores.len() as f64, slam.graph().counts());
    evaluate(&slam);
    if std::env::var("NOFIN").is_err() { slam.finish(); }
    println!("finished {:.1} s {:?}", begin.elapsed().as_secs_f64(), slam.graph().counts());
    evaluate(&slam);
    if std::env::var("EDGES").is_ok() { for e in slam.graph().edges() { let p = slam.graph().poses(); let r = fht_robot::pose_graph::residual(e, &p[e.from], &p[e.to]); let kind = if e.is_doubtful { "loop" } else if e.from + 1 == e.to && (e.information - e.information.transpose()).norm() < 1e9 && e.information[(2,2)] < 2e5 { "odo?" } else { "scan" };
        let c = e.information.try_inverse().unwrap_or_default();
        println!("edge {kind} {} {} res {:.3} {:.3} {:.4} sig {:.3} {:.3} {:.4} chi2 {:.1}", e.from, e.to, r.x, r.y, r.z, c[(0,0)].sqrt(), c[(1,1)].sqrt(), c[(2,2)].sqrt(), fht_robot::pose_graph::chi2(e, p)); } }
    // picture
    let res = 0.05;
    let mut points: Vec<Point2> = Vec::new();
    for (k, p) in slam.keyframes().iter().zip(slam.graph().poses()) { points.extend(k.scan.points_in_base().iter().filter(|q| q.coords.norm() < 25.0).map(|q| p * q)); }
    let (min, max) = points.iter().fold((points[0], points[0]), |(a, b), p| (a.inf(p), b.sup(p)));
    let (w, h) = (((max.x - min.x) / res) as u32 + 1, ((max.y - min.y) / res) as u32 + 1);
    let mut image = image::RgbImage::from_pixel(w, h, image::Rgb([255, 255, 255]));
    for p in &points { let px = image.get_pixel_mut(((p.x - min.x) / res) as u32, h - 1 - ((p.y - min.y) / res) as u32); for c in &mut px.0 { *c = c.saturating_sub(60); } }
    for (_, a) in &trajectory { let p = slam.locate(a).translation; let (x, y) = (((p.x - min.x) / res), h as f64 - 1.0 - ((p.y - min.y) / res)); if x >= 0.0 && y >= 0.0 && (x as u32) < w && (y as u32) < h { image.put_pixel(x as u32, y as u32, image::Rgb([255, 0, 0])); } }
    let name = std::path::Path::new(&args[1]).file_stem().unwrap().to_str().unwrap();
    image.save(format!("/tmp/slam-{name}.png")).unwrap();
}
