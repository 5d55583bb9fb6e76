use super::*;

const CAMERA: &str = r#"{"intrinsic":{"rgb":[[900,0,640],[0,900,360],[0,0,1]]},
    "extrinsic":{"rgb":{"rvec":[0,0,0],"tvec":[[0],[0],[2]]}}}"#;

fn parse(text: &str) -> Result<Calibration> {
    Calibration::parse(text.as_bytes(), Path::new("c.json"))
}

#[test]
fn json_gives_a_camera_that_projects_and_back() {
    let camera = parse(CAMERA).unwrap().rgb;
    assert_eq!(camera, parse(&format!("\u{feff}{CAMERA}")).unwrap().rgb);
    assert_eq!(camera.project([0.0, 0.0, 0.0]), [640.0, 360.0]);
    assert_eq!(camera.project([0.2, -0.1, 0.0]), [730.0, 315.0]);
    assert_eq!(camera.projection[0], [900.0, 0.0, 640.0, 1280.0]);
    let point = camera.back_projection().unwrap().point(730.0, 315.0, 2.0);
    for (a, b) in point.iter().zip([0.2, -0.1, 0.0]) {
        assert!((a - b).abs() < 1e-12);
    }
}

/// Points were projected as if there were none, and triangulated with it.
#[test]
fn the_skew_counts_in_either_direction() {
    let camera = parse(&CAMERA.replace("900,0,640", "900,30,640")).unwrap().rgb;
    let [column, row] = camera.project([0.2, -0.1, 0.0]);
    assert_eq!([column, row], [728.5, 315.0]);
    let point = camera.back_projection().unwrap().point(column, row, 2.0);
    assert!(point.iter().zip([0.2, -0.1, 0.0]).all(|(a, b)| (a - b).abs() < 1e-12), "{point:?}");
    let other = parse(CAMERA).unwrap().rgb;
    assert!(!camera.is_near(&other));
    for (off, near) in [(5e-5, true), (1e-2, false)] {
        let mut rounded = camera.clone();
        rounded.translation[2] += off;
        assert_eq!(camera.is_near(&rounded), near, "{off}");
    }
}

/// The camera with a projection of a focal length and a distance, times a factor.
fn projected(focal: f64, away: f64, factor: f64) -> String {
    let rows = [
        [focal, 0.0, 640.0, 640.0 * away],
        [0.0, focal, 360.0, 360.0 * away],
        [0.0, 0.0, 1.0, away],
    ];
    let rows = rows.map(|row| row.map(|v| v * factor));
    CAMERA.replace("\"rvec\"", &format!("\"projMatrix\":{rows:?},\"rvec\""))
}

#[test]
fn a_projection_is_that_of_the_other_parts_up_to_a_factor_and_rounding() {
    for (focal, factor) in [(900.0, 1.0), (900.0, -0.5), (900.4, 1.0)] {
        let camera = parse(&projected(focal, 2.0, factor)).unwrap().rgb;
        assert_eq!(camera.projection[0][0], focal * factor);
    }
}

#[test]
fn what_is_missing_or_wrong_is_named() {
    for (text, part) in [
        ("{}", "no colour camera"),
        ("[1, 2", "not readable as JSON"),
        (&CAMERA.replace("\"tvec\"", "\"t\""), "no 'tvec'"),
        (&CAMERA.replace("900,0,640", "900,0"), "'intrinsic' of camera 'rgb' is not 3 by 3"),
        ("no pickle", "byte 1: operation 'n'"),
        // Finite numbers that would leave the range of single precision, or any room.
        (&CAMERA.replace("900,0,640", "1e39,0,640"), "camera 'rgb': 'intrinsic' is not a camera"),
        (&CAMERA.replace("[0,0,1]", "[0,0,0]"), "'intrinsic' is not a camera"),
        (&CAMERA.replace("900,0,640", "2700,0,640"), "focal lengths of 2700 and 900 px"),
        (&CAMERA.replace("900,0,640", "900,300,640"), "a skew of 300 px"),
        (&CAMERA.replace("[2]", "[1e39]"), "'tvec' puts the camera more than 100 m away"),
        (
            &CAMERA.replace("[0,0,0]", "[[1e-39,0,0],[0,1,0],[0,0,1]]"),
            "camera 'rgb': 'rvec' is not a rotation",
        ),
        (&CAMERA.replace("[0,0,0]", "[[1,0,0],[0,1,0],[0,0,-1]]"), "'rvec' is a mirrored rotation"),
        (&CAMERA.replace("[0,0,0]", "[1e200,0,0]"), "'rvec' is not a rotation"),
        // Of a focal length of 600 px, and of another place.
        (&projected(600.0, 2.0, 1.0), "'projMatrix' is not 'intrinsic' times 'rvec' and 'tvec'"),
        (&projected(900.0, 2.1, 1.0), "'projMatrix' is not 'intrinsic' times 'rvec' and 'tvec'"),
        (&projected(900.0, 2.0, 0.0), "'projMatrix' is not 'intrinsic' times 'rvec' and 'tvec'"),
    ] {
        let error = parse(text).unwrap_err().to_string();
        assert!(error.starts_with("c.json: ") && error.contains(part), "{error}");
    }
}
