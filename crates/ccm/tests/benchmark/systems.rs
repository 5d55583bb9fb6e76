//! A system that a caller brings along.

use std::sync::{Arc, Mutex};

use corsmal_ccm::CcmError;
use corsmal_ccm::benchmark::{BenchmarkOptions, Estimate, Prepared, System, Work};
use corsmal_ccm::synth::{self, Size};
use corsmal_report::Cell;

use crate::{options, run};

/// Says what it knows, and always the same.
pub struct Constant;

struct Ready<'a>(&'a Work<'a>);

impl System for Constant {
    fn name(&self) -> &'static str {
        "M4"
    }

    fn prepare<'a>(&'a self, work: &'a Work<'a>) -> corsmal_ccm::Result<Box<dyn Prepared + 'a>> {
        for (place, subject) in work.subjects.iter().enumerate() {
            // Nothing tells what a test recording holds.
            let training = place < work.training;
            assert_eq!(subject.filling.is_some(), training);
            assert_eq!(subject.name.is_some(), training);
            assert_eq!(subject.action.is_some(), training);
            assert!(subject.input.labels.is_empty());
        }
        Ok(Box::new(Ready(work)))
    }
}

impl Prepared for Ready<'_> {
    fn notes(&self) -> Vec<String> {
        vec!["it always says rice.".into()]
    }

    fn predict(
        &self,
        train: &[usize],
        wanted: &[usize],
    ) -> corsmal_ccm::Result<Vec<Vec<Estimate>>> {
        let container = |row: &usize| self.0.subjects[*row].container;
        let known: Vec<_> = train.iter().map(container).collect();
        assert!(train.iter().all(|&row| row < self.0.training));
        assert!(wanted.iter().all(|row| !known.contains(&container(row))));
        let rice = || Estimate { kind: Some(2), ..Estimate::default() };
        Ok(vec![wanted.iter().map(|_| rice()).collect()])
    }
}

/// Cannot be trained.
struct Failing;

impl System for Failing {
    fn name(&self) -> &'static str {
        "M6"
    }

    fn prepare<'a>(&'a self, _: &'a Work<'a>) -> corsmal_ccm::Result<Box<dyn Prepared + 'a>> {
        Ok(Box::new(Failing))
    }
}

impl Prepared for Failing {
    fn notes(&self) -> Vec<String> {
        Vec::new()
    }

    fn predict(&self, _: &[usize], _: &[usize]) -> corsmal_ccm::Result<Vec<Vec<Estimate>>> {
        Err(CcmError::Request("M6: too few classes".into()))
    }
}

#[test]
fn a_system_is_run_on_containers_that_it_never_heard() {
    let dir = tempfile::tempdir().unwrap();
    let (data, out) = (dir.path().join("data"), dir.path().join("report"));
    synth::generate(&data, Size::Reduced, 3).unwrap();
    let systems: Vec<Box<dyn System>> = vec![Box::new(Constant)];
    let report = run(&BenchmarkOptions { systems, ..options(&data, &out, Vec::new()) }).unwrap();
    let tables: Vec<_> = report.sections.iter().flat_map(|s| &s.tables).collect();
    let rows = |table: &str| {
        let table = tables.iter().find(|t| t.name == table).unwrap();
        table.rows.iter().filter(|r| r.cells[0] == Cell::Text("M4".into())).count()
    };
    // The paper's row and that of this run; only the paper's where nothing is estimated.
    assert_eq!((rows("type"), rows("level")), (2, 1));
    let texts: Vec<_> = report.sections.iter().flat_map(|s| &s.text).collect();
    assert!(texts.iter().any(|t| *t == "M4 of this run: it always says rice."));
    assert!(report.sections.iter().all(|s| s.id != "corrections"));
    for name in ["submissions/m4-held-out.csv", "submissions/m4-public-test.csv"] {
        assert!(out.join(name).exists(), "{name}");
    }
    assert!(out.join("figures/m4-type-confusion.svg").exists());
    assert!(!out.join("figures/m4-level-confusion.svg").exists());

    // One that fails does not take the others with it.
    let systems: Vec<Box<dyn System>> = vec![Box::new(Failing), Box::new(Constant)];
    let two = BenchmarkOptions { systems, ..options(&data, &out, Vec::new()) };
    let said = Mutex::new(Vec::new());
    let progress = |step: &str| said.lock().unwrap().push(step.to_owned());
    let finished = corsmal_ccm::benchmark::run(&two, &progress, &Arc::default()).unwrap();
    let reason = "M6: too few classes (fold 1 of 3, trained on 76 recordings)";
    assert_eq!(finished.failed, [reason]);
    let told = reason.replace("M6: ", "warning: M6 is left out: ");
    assert!(said.lock().unwrap().contains(&told));
    let texts: Vec<_> = finished.report.sections.iter().flat_map(|s| &s.text).collect();
    assert!(texts.contains(&&format!("Left out: {reason}.")), "{texts:?}");
    assert!(texts.iter().any(|t| *t == "M4 of this run: it always says rice."));
    let systems: Vec<Box<dyn System>> = vec![Box::new(Failing)];
    let alone = BenchmarkOptions { systems, ..options(&data, &out, Vec::new()) };
    assert_eq!(run(&alone).unwrap_err().to_string(), reason);

    let systems: Vec<Box<dyn System>> = vec![Box::new(Constant), Box::new(Constant)];
    let twice = BenchmarkOptions { systems, ..options(&data, &out, Vec::new()) };
    assert_eq!(run(&twice).unwrap_err().to_string(), "M4 is given twice");
}
