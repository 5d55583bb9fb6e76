//! Networks: weights of any program (`.safetensors`, `.npz`, `.pth`), trained networks and what they
//! listen to.
#![no_main]

use std::sync::LazyLock;

use corsmal_nets::capacity::CapacityNetwork;
use corsmal_nets::dataset::Dataset;
use corsmal_nets::model::NetModel;
use corsmal_nets::network::Network;
use corsmal_nets::{networks, weights};

static M1: LazyLock<Network> = LazyLock::new(|| {
    let m1 = networks::named("m1").expect("a published network");
    m1.build(Some(2), 0).expect("two classes")
});

libfuzzer_sys::fuzz_target!(init: corsmal_fuzz::ours_only(), |bytes: &[u8]| {
    let path = corsmal_fuzz::file("network", bytes);
    if let Ok(state) = weights::read(&path) {
        let values: usize = state.iter().map(|(_, _, values)| values.len()).sum();
        assert!(values <= 1 << 26, "{values} numbers from {} bytes", bytes.len());
    }
    if let Ok(model) = NetModel::load(&path) {
        let again = model.to_bytes().expect("what was read can be written");
        assert!(NetModel::from_bytes(&again).is_ok());
    }
    let _ = CapacityNetwork::read(&path);
    let _ = Dataset::read(&path, &M1);
});
