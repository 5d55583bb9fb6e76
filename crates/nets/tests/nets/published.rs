//! Published weights give the published numbers.

use corsmal_files::npz::NpzFile;
use corsmal_nets::batch::{Batch, Shape};
use corsmal_nets::capacity::CapacityNetwork;
use corsmal_nets::layers::softmax;
use corsmal_nets::{networks, weights};

use crate::shared;

#[test]
fn m2_finds_nothing_in_the_empty_container() {
    let Some(published) = shared("data/ccm/weights/m2_filling_type_cnn.npz") else { return };
    let Some(inputs) = shared("data/ccm/method_input_reference.npz") else { return };
    let mut network = networks::named("m2-type").unwrap().build(None, 0).unwrap();
    network.load_state(&weights::read(&published).unwrap()).unwrap();
    let mut reference = NpzFile::open(&inputs).unwrap();
    let mut mfcc = reference.f32("m2_mfcc_norm").unwrap().iter().copied().collect::<Vec<_>>();
    mfcc.resize(1501 * 40, 0.0);
    let shape = Shape::Image { height: 1501, width: 40, channels: 1 };
    let logits = network.forward(&[Batch::new(mfcc, shape)]).unwrap();
    let expected = reference.f32("m2_logits").unwrap();
    for (got, want) in logits.values.values().iter().zip(&expected) {
        assert!((got - want).abs() < 1e-3, "{got} {want}");
    }
    let mut p = logits.values.values().to_vec();
    softmax(&mut p, 4);
    assert!((p[0] - 0.9998).abs() < 1e-3, "{p:?}");
}

#[test]
fn m2_estimates_the_published_capacities() {
    let Some(published) = shared("data/ccm/weights/m2_capacity_cnn.npz") else { return };
    let Some(reference) = shared("data/ccm/m2_capacity_reference.npz") else { return };
    let network = CapacityNetwork::read(&published).unwrap();
    let mut reference = NpzFile::open(&reference).unwrap();
    let mut array = |name| {
        let array = reference.f32(name).unwrap();
        (array.shape().to_vec(), array.iter().copied().collect::<Vec<f32>>())
    };
    let (depths, sizes, expected) = (array("x").1, array("box").1, array("millilitres").1);
    assert_eq!(expected.len(), 3);
    for (i, want) in expected.into_iter().enumerate() {
        let depth = &depths[i * 112 * 112..][..112 * 112];
        let got = network.millilitres(depth, [sizes[2 * i], sizes[2 * i + 1]]).unwrap();
        assert!((got - f64::from(want)).abs() < 0.05, "{got} {want}");
    }
    let other = shared("data/ccm/weights/m2_filling_type_cnn.npz").unwrap();
    let error = CapacityNetwork::read(&other).unwrap_err().to_string();
    assert!(error.contains("not the weights of M2's capacity network"), "{error}");
}

/// The features are stored in half precision: that alone changes probabilities by 1.5e-4.
#[test]
fn m5_gives_its_228_published_types() {
    let Some(published) = shared("data/ccm/weights/m5_r21d_type_gru_trained_on_1_2_4_5_7_8.npz")
    else {
        return;
    };
    let Some(features) = shared("data/ccm/r21d_train_f16.npz") else { return };
    let Some(expected) = shared("data/ccm/m5_predictions/valid_type_r21d.csv") else { return };
    let mut network = networks::named("m5_r21d_type").unwrap().build(None, 0).unwrap();
    network.load_state(&weights::read(&published).unwrap()).unwrap();

    let expected: Vec<(String, Vec<f32>)> = std::fs::read_to_string(expected)
        .unwrap()
        .lines()
        .skip(1)
        .map(|line| line.split(',').collect::<Vec<_>>())
        .map(|f| {
            (format!("{}/{}", f[0], f[1]), f[2..].iter().map(|v| v.parse().unwrap()).collect())
        })
        .collect();
    let mut npz = NpzFile::open(&features).unwrap();
    let x = npz.f32("X").unwrap().iter().copied().collect::<Vec<_>>();
    let ints = |npz: &mut NpzFile, name| {
        npz.integers(name).unwrap().iter().map(|&v| v as usize).collect::<Vec<_>>()
    };
    let offsets = ints(&mut npz, "offsets");
    let (containers, views) = (ints(&mut npz, "container"), ints(&mut npz, "view"));
    let sequences = npz.strings("sequence").unwrap();

    // Four rows a recording, one for each view; containers in this order, names sorted.
    let mut rows: Vec<usize> =
        (0..views.len()).filter(|&r| views[r] == 1 && [3, 6, 9].contains(&containers[r])).collect();
    rows.sort_by_key(|&r| (containers[r], sequences[r].clone()));
    assert_eq!(rows.len(), 228);
    for batch in rows.chunks(64) {
        let length = |r: usize| offsets[r + 1] - offsets[r];
        let longest = batch.iter().map(|&r| length(r)).max().unwrap();
        let shape = Shape::Sequence { steps: longest, numbers: 512 };
        let inputs: Vec<Batch> = (0..4)
            .map(|view| {
                let mut values = Vec::new();
                for &r in batch {
                    let r = r + view;
                    assert_eq!(views[r], view + 1);
                    values.extend(&x[offsets[r] * 512..offsets[r + 1] * 512]);
                    values.extend(std::iter::repeat_n(-10.0, (longest - length(r)) * 512));
                }
                Batch::new(values, shape)
            })
            .collect();
        let mut proba = network.forward(&inputs).unwrap().values.into_values();
        softmax(&mut proba, 4);
        for (got, &r) in proba.chunks(4).zip(batch) {
            let id = format!("{}/{}", containers[r], sequences[r]);
            let (_, want) = expected.iter().find(|(i, _)| *i == id).unwrap();
            let label = |p: &[f32]| (0..4).max_by(|&a, &b| p[a].total_cmp(&p[b]));
            assert_eq!(label(got), label(want), "{id}");
            for (g, w) in got.iter().zip(want) {
                assert!((g - w).abs() < 2e-4, "{id}: {got:?} {want:?}");
            }
        }
    }
}
