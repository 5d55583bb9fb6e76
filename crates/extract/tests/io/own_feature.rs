//! The example of a feature of one's own runs, and what it registers is a feature like any other.

use corsmal_extract::config::Config;
use corsmal_extract::features::registry;

#[path = "../../examples/own_feature.rs"]
mod example;

#[test]
fn the_example_runs_and_its_feature_is_like_any_other() {
    let built_in = registry().len();
    example::main().unwrap();
    let kinds: Vec<&str> = registry().iter().map(|entry| entry.kind()).collect();
    assert_eq!(kinds[built_in..], ["crest_factor"]);
    // A name is given once.
    assert!(
        example::main().unwrap_err().to_string().contains("already a feature \"crest_factor\"")
    );
    // Keys and values are checked, slips are recognised.
    let refused = |text: &str| Config::with_overrides(text, "test", &[]).unwrap_err().to_string();
    let refusal = refused("[features.crest_factor]\nquietest = 0");
    let expected = "configuration key features.crest_factor: quietest must be above 0, not 0";
    assert!(refusal.starts_with(expected), "{refusal}");
    let refusal = refused("[features.crest_factor]\nquiet = 1");
    assert!(refusal.contains("did you mean \"quietest\"?"), "{refusal}");
    let refusal = refused("[features.crestfactor]");
    assert!(refusal.contains("did you mean \"crest_factor\"?"), "{refusal}");
}
