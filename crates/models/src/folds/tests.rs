//! Which rows are held out together, on tables of four rows.

use super::*;

/// Four rows, r0 to r3, with these columns.
fn table<const N: usize>(columns: [(&str, [&str; 4]); N]) -> LabelledTable {
    let owned = |values: [&str; 4]| values.map(String::from).to_vec();
    let columns = columns.map(|(name, values)| (name.to_string(), owned(values)));
    let ids = owned(["r0", "r1", "r2", "r3"]);
    LabelledTable::of_columns(std::path::Path::new("x.npz"), ids, columns.to_vec())
}

#[test]
fn rows_without_a_group_or_fold_are_refused() {
    let table = table([("y", ["a", "b", "a", "b"]), ("f", ["1", "", "2", "NaN"])]);
    let (labels, classes) = table.classes("y").unwrap();
    let folds = |plan: &str, groups| {
        let plan: CvPlan = plan.parse().unwrap();
        Folds::new(Some(&plan), &table, groups, (&labels, &classes), 0)
    };
    for (plan, groups) in [("fold=f", None), ("group=f", None), ("2", Some("f"))] {
        let refused = folds(plan, groups).unwrap_err().to_string();
        let expected = "2 rows without f of 4, the first is r1";
        assert!(refused.contains(expected), "{plan}: {refused}");
    }
    assert!(folds("2", None).is_ok());
}

/// Windows of recordings: the recordings were the groups, not what contains them.
#[test]
fn containers_of_windows_are_groups() {
    let windows = table([
        ("y", ["a", "b", "a", "b"]),
        ("recording", ["r1", "r2", "r3", "r4"]),
        ("container", ["1", "1", "2", "2"]),
    ]);
    let (labels, classes) = windows.classes("y").unwrap();
    let folds = |plan: Option<&CvPlan>, groups| {
        Folds::new(plan, &windows, groups, (&labels, &classes), 0).unwrap()
    };
    let containers = Some(&["1", "1", "2", "2"].map(String::from)[..]);
    assert_eq!(folds(None, None).dependent(), containers);
    assert_eq!(folds(Some(&CvPlan::Group("container".into())), None).dependent(), containers);
    assert_eq!(folds(None, Some("container")).dependent(), containers);
    let choice = Folds::for_choice(&windows, None, (&labels, &classes), 0).unwrap();
    assert_eq!(choice.groups(), containers);
    let said = folds(Some(&CvPlan::K(2)), None).warnings(&classes).join(" ");
    assert!(said.contains("--groups container"), "{said}");
    // Of two usual columns the first is taken, whether or not it splits the other.
    let both = table([
        ("y", ["a", "b", "a", "b"]),
        ("container", ["1", "1", "2", "2"]),
        ("group", ["p", "q", "p", "q"]),
        ("half", ["1", "2", "2", "1"]),
    ]);
    let (labels, classes) = both.classes("y").unwrap();
    let said = |plan: Option<&CvPlan>| {
        let found = Folds::new(plan, &both, None, (&labels, &classes), 0).unwrap();
        found.warnings(&classes).join(" ")
    };
    let split = "rows of one group are in both training and test: --groups group";
    assert!(said(None).contains(split), "{}", said(None));
    let halves = said(Some(&CvPlan::Fold("half".into())));
    assert!(halves.contains("the scores are not those of a new container"), "{halves}");
    // A recording that belongs to two groups is split by them.
    let odd = table([
        ("y", ["a", "b", "a", "b"]),
        ("recording", ["r1", "r1", "r2", "r2"]),
        ("container", ["1", "2", "2", "1"]),
    ]);
    let (labels, classes) = odd.classes("y").unwrap();
    let split = Folds::new(None, &odd, None, (&labels, &classes), 0).unwrap_err().to_string();
    assert!(split.contains("recording r1 is in the folds 1 and 2"), "{split}");
}

#[test]
fn groups_that_a_plan_splits_are_said_and_the_target_is_none() {
    let grouped = table([("container", ["a", "b", "a", "b"]), ("group", ["1", "1", "2", "2"])]);
    let (labels, classes) = grouped.classes("container").unwrap();
    let folds = |plan: Option<&CvPlan>, groups| {
        Folds::new(plan, &grouped, groups, (&labels, &classes), 0).unwrap()
    };
    assert_eq!(folds(None, None).description, "each group once");
    let said = folds(Some(&CvPlan::K(2)), None).warnings(&classes).join(" ");
    assert!(said.contains("one group are in both") && said.contains("--groups group"), "{said}");
    let kept = folds(Some(&CvPlan::K(2)), Some("group")).warnings(&classes).join(" ");
    assert!(!kept.contains("--groups"), "{kept}");

    // A target of this name was its own groups: each fold was of a class that no other had.
    let sound = ["studio", "phone", "studio", "phone"];
    let named = table([("recording", sound)]);
    let (of_sound, sounds) = named.classes("recording").unwrap();
    let found = Folds::new(Some(&CvPlan::K(2)), &named, None, (&of_sound, &sounds), 0).unwrap();
    assert!(found.description.contains("stratified"), "{}", found.description);

    let apart = table([("y", ["a", "b", "a", "b"]), ("group", ["1", "2", "3", ""])]);
    let (y, of_y) = apart.classes("y").unwrap();
    let whole = Folds::new(Some(&CvPlan::K(2)), &apart, None, (&y, &of_y), 0).unwrap();
    assert!(!whole.warnings(&of_y).join(" ").contains("--groups"), "no group has two rows");

    let by_group = folds(None, None);
    let refused = by_group.inner(&[0, 1], &classes).unwrap_err().to_string();
    assert!(refused.contains("all of one group") && refused.contains("--tune"), "{refused}");
}

/// A column `group` of parts of recordings took their place.
#[test]
fn groups_finer_than_recordings_are_none() {
    let columns = |groups: [&'static str; 4]| {
        table([
            ("y", ["a", "b", "a", "b"]),
            ("recording", ["r1", "r1", "r2", "r2"]),
            ("group", groups),
            ("half", ["1", "1", "2", "2"]),
        ])
    };
    let plan = CvPlan::Fold("half".into());
    for (groups, kept) in [
        (["p", "q", "s", "t"], ["r1", "r1", "r2", "r2"]),
        (["p", "p", "q", "q"], ["p", "p", "q", "q"]),
    ] {
        let table = columns(groups);
        let (labels, classes) = table.classes("y").unwrap();
        let folds = Folds::new(Some(&plan), &table, None, (&labels, &classes), 0).unwrap();
        assert_eq!(folds.dependent(), Some(&kept.map(String::from)[..]));
    }
}

/// Of two containers one was left to train on, and `--tune` was refused.
#[test]
fn parameters_are_chosen_on_recordings_of_a_single_group() {
    let rows = table([
        ("y", ["a", "b", "a", "b"]),
        ("recording", ["r1", "r2", "r3", "r4"]),
        ("container", ["c1", "c1", "c2", "c2"]),
        ("half", ["1", "1", "2", "2"]),
    ]);
    let (labels, classes) = rows.classes("y").unwrap();
    let plan = CvPlan::Fold("half".into());
    let folds = |groups| Folds::new(Some(&plan), &rows, groups, (&labels, &classes), 0).unwrap();
    let found = folds(None);
    assert_eq!(found.dependent().unwrap(), ["c1", "c1", "c2", "c2"]);
    let inner = found.inner(&found.outer[0].train, &classes).unwrap();
    assert_eq!(inner.len(), 2);
    let said = found.choice_warning().unwrap();
    assert!(said.contains("fold 1 trains on one container alone"), "{said}");
    // Groups that are asked for are kept.
    let named = folds(Some("container"));
    assert_eq!(named.choice_warning(), None);
    assert!(named.inner(&named.outer[0].train, &classes).is_err());
}

/// Rows of other programs that are only numbered, with ids that they share.
mod shared_ids {
    use super::*;

    fn numbered(ids: [&'static str; 4], y: [&'static str; 4]) -> LabelledTable {
        let mut rows = table([("id", ids), ("y", y), ("site", ["s", "t", "t", "s"])]);
        rows.numbered = true;
        rows
    }

    fn folds(table: &LabelledTable, plan: Option<&str>, groups: Option<&str>) -> Result<Folds> {
        let plan = plan.map(|plan| plan.parse::<CvPlan>().unwrap());
        let (labels, classes) = table.classes("y").unwrap();
        Folds::new(plan.as_ref(), table, groups, (&labels, &classes), 0)
    }

    fn warnings(table: &LabelledTable, plan: &str) -> String {
        let (_, classes) = table.classes("y").unwrap();
        folds(table, Some(plan), None).unwrap().warnings(&classes).join(" ")
    }

    #[test]
    fn are_recordings_with_as_many_folds_as_there_are() {
        let rows = numbered(["1", "1", "2", "2"], ["a", "b", "a", "b"]);
        let found = folds(&rows, None, None).unwrap();
        assert_eq!((found.outer.len(), found.description.as_str()), (2, "2 folds (id)"));
        let refused = folds(&rows, Some("3"), None).unwrap_err().to_string();
        assert!(refused.contains("a value of id stay together, and 2 values"), "{refused}");
        let refused = folds(&rows, Some("group=site"), None).unwrap_err().to_string();
        assert!(refused.contains("--groups site allows it"), "{refused}");
        for plan in ["group=site", "fold=site"] {
            assert!(folds(&rows, Some(plan), Some("site")).is_ok());
        }
    }

    #[test]
    fn that_stand_for_classes_are_no_recordings() {
        let rows = numbered(["0", "1", "0", "1"], ["a", "b", "a", "b"]);
        let found = folds(&rows, Some("2"), None).unwrap();
        assert!(found.description.contains("stratified") && found.groups().is_none());
        assert!(warnings(&rows, "2").contains("all rows of a class have the same one"));
    }

    #[test]
    fn that_are_missing_or_all_the_same_are_told() {
        let rows = numbered(["1", "1", "", "2"], ["a", "b", "a", "b"]);
        let said = warnings(&rows, "2");
        assert!(said.contains("in both training and test (1 row without one)"), "{said}");
        let rows = numbered(["1"; 4], ["a", "b", "a", "b"]);
        assert!(warnings(&rows, "2").contains("parts of one recording"));
        let apart = numbered(["1", "2", "", "3"], ["a", "b", "a", "b"]);
        assert_eq!(warnings(&apart, "2"), "");
    }

    #[test]
    fn that_inner_folds_split_are_named() {
        let mut rows = table([
            ("id", ["1", "1", "2", "2"]),
            ("y", ["a", "b", "b", "a"]),
            ("group", ["s", "t", "t", "s"]),
        ]);
        rows.numbered = true;
        let (labels, classes) = rows.classes("y").unwrap();
        let refused =
            Folds::for_choice(&rows, None, (&labels, &classes), 0).unwrap_err().to_string();
        assert!(
            refused.contains("inner folds: id 1 is in") && refused.contains("--groups group"),
            "{refused}"
        );
    }
}
