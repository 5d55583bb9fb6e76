//! Capacities from 1280 by 720 images: LoDE on a pair of masks, M4's cuboid, M2's region, reading depth.

use std::path::PathBuf;

use corsmal_vision::cuboid::{Outliers, cuboid};
use corsmal_vision::lode::{Variant, View, dimensions};
use corsmal_vision::{Camera, Depth, Mask, region};
use divan::Bencher;

fn main() {
    divan::main();
}

const SIZE: (usize, usize) = (1280, 720);

/// A camera 1.2 m from the origin that looks at it from above.
fn camera(around: f64) -> Camera {
    let (s, c) = around.sin_cos();
    let (ts, tc) = 25f64.to_radians().sin_cos();
    let rotation = [[-s, c, 0.0], [c * ts, s * ts, -tc], [-c * tc, -s * tc, -ts]];
    let k = [[920.0, 0.0, 640.0], [0.0, 920.0, 360.0], [0.0, 0.0, 1.0]];
    Camera::new(k, rotation, [0.0, 0.06, 1.2])
}

/// What a camera sees of a cylinder of 80 by 120 mm that stands on the origin: mask and depth.
fn cylinder(camera: &Camera) -> (Depth, Mask) {
    let mut depth = Depth { width: SIZE.0, height: SIZE.1, data: vec![0; SIZE.0 * SIZE.1] };
    for h in 0..480 {
        for a in 0..1440 {
            let (s, c) = (f64::from(a) / 4.0).to_radians().sin_cos();
            let p = [0.04 * c, 0.04 * s, 0.00025 * f64::from(h)];
            let [x, y] = camera.project(p);
            let row = camera.projection[2];
            let mm = 1000.0 * (row[0] * p[0] + row[1] * p[1] + row[2] * p[2] + row[3]);
            let pixel = &mut depth.data[y as usize * SIZE.0 + x as usize];
            if *pixel == 0 || mm < f64::from(*pixel) {
                *pixel = mm as u16;
            }
        }
    }
    let data = depth.data.iter().map(|mm| *mm > 0).collect();
    let mask = Mask { width: SIZE.0, height: SIZE.1, data };
    (depth, mask.closed(2))
}

#[divan::bench(args = ["published", "corrected"])]
fn lode_pair(bencher: Bencher, variant: &str) {
    let variant = if variant == "published" { Variant::Published } else { Variant::Corrected };
    let cameras = [camera(0.4), camera(1.5)];
    let masks = [0, 1].map(|i| cylinder(&cameras[i]).1);
    let views = [0, 1].map(|i| View { mask: &masks[i], camera: &cameras[i] });
    bencher.bench_local(|| dimensions(views, variant).unwrap());
}

#[divan::bench(args = ["forests", "all points"])]
fn m4_cuboid(bencher: Bencher, outliers: &str) {
    let outliers = if outliers == "forests" { Outliers::Corrected } else { Outliers::Kept };
    let camera = camera(0.4);
    let (depth, mask) = cylinder(&camera);
    bencher.bench_local(|| cuboid(&depth, &mask, &camera, outliers, 1).unwrap());
}

#[divan::bench]
fn m2_region(bencher: Bencher) {
    let (mut depth, _) = cylinder(&camera(0.4));
    // Nearer, and large enough.
    depth.data.iter_mut().for_each(|mm| *mm = mm.saturating_sub(700));
    for row in 200..500 {
        depth.data[row * SIZE.0 + 500..row * SIZE.0 + 700].fill(450);
    }
    bencher.bench_local(|| region::region(&depth).unwrap());
}

#[divan::bench]
fn read_depth_png(bencher: Bencher) {
    let noisy = |i: usize| 900 + (i * 2_654_435_761 % 7) as u16;
    let data = (0..SIZE.0 * SIZE.1).map(noisy).collect();
    let dir = tempfile::tempdir().unwrap();
    let path: PathBuf = dir.path().join("depth.png");
    let depth = Depth { width: SIZE.0, height: SIZE.1, data };
    std::fs::write(&path, depth.to_png().unwrap()).unwrap();
    bencher.bench_local(|| Depth::read(&path).unwrap());
}
