//! How well the classifier does, what it relies on, and whether more data would help.

use corsmal_plot::{ConfusionMatrix, Line, LinePlot, Mark, ScorePlot, ScoreRow};

use super::content::{self, Study};
use crate::{Cell, Figure, Result, Row, Section, Source, Table, capitalised};

/// Scores of all held-out rows and of each fold, and calibration.
pub(super) fn section(study: &Study) -> Result<Option<Section>> {
    if study.scores.is_empty() {
        return Ok(None);
    }
    let text = [&study.protocol, &study.intervals];
    let text = text.into_iter().filter(|t| !t.is_empty()).cloned().collect();
    let mut rows = vec![Row {
        source: Source::Ours,
        cells: std::iter::once(Cell::text("all rows"))
            .chain(study.scores.iter().map(|s| Cell::Score(s.value, s.interval)))
            .collect(),
    }];
    let part = |name: String, scores: &[f64]| Row {
        source: Source::Ours,
        cells: std::iter::once(Cell::text(name))
            .chain(scores.iter().map(|v| Cell::score(Some(*v))))
            .collect(),
    };
    rows.extend(study.folds.iter().map(|(name, scores)| part(format!("fold {name}"), scores)));
    rows.extend(study.seeds.iter().map(|(seed, s)| part(format!("all rows, seed {seed}"), s)));
    let table = Table {
        name: "scores".into(),
        caption: "Scores in percent, with 95 % intervals".into(),
        columns: std::iter::once("Rows".to_owned())
            .chain(study.scores.iter().map(|s| capitalised(&s.name)))
            .collect(),
        rows,
    };
    let mark = |score: &content::Score| ScoreRow {
        name: capitalised(&score.name),
        marks: vec![Mark { series: 0, value: score.value, interval: score.interval }],
    };
    let plot = ScorePlot {
        title: "Scores".into(),
        value_label: "percent".into(),
        series: vec!["rows".into()],
        rows: study.scores.iter().map(mark).collect(),
        range: Some((0.0, 100.0)),
    };
    let mut figures = vec![Figure::new("scores", "", &plot)?];
    if !study.calibration.is_empty() {
        let points = study.calibration.iter().map(|b| (b.confidence, b.accuracy)).collect();
        let plot = LinePlot {
            title: "Calibration".into(),
            x_label: "confidence of the prediction".into(),
            y_label: "share of right predictions".into(),
            x_range: Some((0.0, 1.0)),
            y_range: Some((0.0, 1.0)),
            lines: vec![Line { name: "rows".into(), points, band: Vec::new() }],
            diagonal: true,
            dots: true,
            joined: true,
        };
        let caption = "On the dashed line, 80 of 100 predictions with a confidence of 0.8 are right. \
                       Below it, the classifier is overconfident.";
        figures.push(Figure::new("calibration", caption, &plot)?);
    }
    let mut tables = vec![table];
    tables.extend(measures(study));
    Ok(Some(Section { text, figures, tables, ..Section::new("scores", "Scores") }))
}

/// Measures of the probabilities.
fn measures(study: &Study) -> Option<Table> {
    let row = |(name, value, meaning): &(String, f64, String)| Row {
        source: Source::Ours,
        cells: vec![
            Cell::text(name),
            Cell::Number(*value, format!("{value:.4}")),
            Cell::text(meaning),
        ],
    };
    (!study.measures.is_empty()).then(|| Table {
        name: "measures".into(),
        caption: "Measures of the probabilities, 0 to 1 unless stated otherwise".into(),
        columns: ["Measure", "Value", "Meaning"].map(String::from).to_vec(),
        rows: study.measures.iter().map(row).collect(),
    })
}

/// Classes of the largest matrix that is drawn.
const DRAWN: usize = 100;

/// Which classes are taken for which.
pub(super) fn confusion(study: &Study) -> Result<Option<Section>> {
    if study.confusion.is_empty() {
        return Ok(None);
    }
    let plot = (study.classes.len() <= DRAWN).then(|| ConfusionMatrix {
        title: format!("Confusion of {}", study.target),
        labels: study.classes.clone(),
        counts: study.confusion.clone(),
        f1: study.class_scores.iter().map(|c| c.f1).collect(),
    });
    let row = |(name, scores): (&String, &content::ClassScore)| Row {
        source: Source::Ours,
        cells: vec![
            Cell::text(name),
            Cell::score(Some(scores.precision)),
            Cell::score(Some(scores.recall)),
            Cell::score(Some(scores.f1)),
            Cell::count(scores.support),
        ],
    };
    let table = Table {
        name: "classes".into(),
        caption: "Scores of each class in percent".into(),
        columns: ["Class", "Precision", "Recall", "F1", "Rows"].map(String::from).to_vec(),
        rows: study.classes.iter().zip(&study.class_scores).map(row).collect(),
    };
    let text = match plot {
        Some(_) => "A cell's shade is its share of the true class.".into(),
        None => format!("The matrix of more than {DRAWN} classes is not drawn."),
    };
    let section = Section {
        text: vec![text],
        tables: vec![table],
        ..Section::new("confusion", "Class by class")
    };
    Ok(Some(match &plot {
        Some(plot) => pictured(section, "confusion", plot)?,
        None => section,
    }))
}

/// Curves drawn in one plot: more could not be told apart.
const CURVES: usize = 6;

/// ROC and precision-recall curves of the classes that are hardest to tell from the others.
pub(super) fn curves(study: &Study) -> Result<Option<Section>> {
    if study.curves.is_empty() {
        return Ok(None);
    }
    let mut hardest: Vec<&content::ClassCurve> = study.curves.iter().collect();
    hardest.sort_by(|a, b| a.roc_auc.total_cmp(&b.roc_auc));
    let plot =
        |title: &str, x: &str, y: &str, points: fn(&content::ClassCurve) -> &[(f64, f64)]| {
            let line = |curve: &&content::ClassCurve| Line {
                name: study.class_name(curve.class).to_owned(),
                points: points(curve).to_vec(),
                band: Vec::new(),
            };
            LinePlot {
                title: title.into(),
                x_label: x.into(),
                y_label: y.into(),
                x_range: Some((0.0, 1.0)),
                y_range: Some((0.0, 1.0)),
                lines: hardest.iter().take(CURVES).map(line).collect(),
                diagonal: title == "ROC",
                dots: false,
                joined: true,
            }
        };
    let roc = plot("ROC", "false positive rate", "true positive rate", |c| &c.roc);
    let pr = plot("Precision and recall", "recall", "precision", |c| &c.precision_recall);
    let row = |curve: &content::ClassCurve| Row {
        source: Source::Ours,
        cells: vec![
            Cell::text(study.class_name(curve.class)),
            Cell::score(Some(100.0 * curve.roc_auc)),
            Cell::score(Some(100.0 * curve.average_precision)),
        ],
    };
    let table = Table {
        name: "curves".into(),
        caption: "Each class against all others, percent".into(),
        columns: ["Class", "Area under ROC", "Average precision"].map(String::from).to_vec(),
        rows: study.curves.iter().map(row).collect(),
    };
    let shown = match study.curves.len() > CURVES {
        true => format!(" The figure shows the {CURVES} classes that are hardest to distinguish."),
        false => String::new(),
    };
    Ok(Some(Section {
        text: vec![format!(
            "Each class against all others, as the threshold on its probability falls.{shown}"
        )],
        figures: vec![Figure::new("roc", "", &roc)?, Figure::new("precision-recall", "", &pr)?],
        tables: vec![table],
        ..Section::new("curves", "Thresholds")
    }))
}

/// What each family of features contributes.
pub(super) fn importances(study: &Study) -> Result<Option<Section>> {
    if study.importances.is_empty() {
        return Ok(None);
    }
    let mut sorted: Vec<_> = study.importances.iter().collect();
    sorted.sort_by(|a, b| b.loss.total_cmp(&a.loss));
    let row = |i: &&content::Importance| ScoreRow {
        name: format!("{} ({})", i.family, i.features),
        marks: vec![Mark { series: 0, value: i.loss, interval: Some(i.range) }],
    };
    let plot = ScorePlot {
        title: "Importance by feature family".into(),
        value_label: "loss of accuracy when permuted, percentage points".into(),
        series: vec!["rows".into()],
        rows: sorted.iter().map(row).collect(),
        range: None,
    };
    let table = Table {
        name: "importances".into(),
        caption: "Permutation importance, percentage points of accuracy".into(),
        columns: ["Family", "Features", "Mean loss", "Smallest", "Largest"]
            .map(String::from)
            .to_vec(),
        rows: sorted
            .iter()
            .map(|i| Row {
                source: Source::Ours,
                cells: vec![
                    Cell::text(&i.family),
                    Cell::count(i.features),
                    Cell::Difference(i.loss),
                    Cell::Difference(i.range.0),
                    Cell::Difference(i.range.1),
                ],
            })
            .collect(),
    };
    let section = Section {
        text: vec![
            "The values of all features of a family are shuffled among the held-out rows (of each \
             fold, or of all folds where one holds out a single class), so they no longer say \
             anything about the class; the accuracy lost is what the models get only from that \
             family. Families that repeat the information of another lose little, \
             even if the two together matter. Whiskers span folds and repetitions."
                .into(),
        ],
        tables: vec![table],
        ..Section::new("importances", "What the classifier relies on")
    };
    Ok(Some(pictured(section, "importances", &plot)?))
}

/// Whether more data would help.
pub(super) fn learning(study: &Study) -> Result<Option<Section>> {
    if study.learning.len() < 2 {
        return Ok(None);
    }
    let plot = LinePlot {
        title: "Learning curve".into(),
        x_label: "training rows".into(),
        y_label: "accuracy, percent".into(),
        x_range: None,
        y_range: None,
        lines: vec![Line {
            name: "rows".into(),
            points: study.learning.iter().map(|p| (p.rows, p.accuracy)).collect(),
            band: study.learning.iter().map(|p| p.range).collect(),
        }],
        diagonal: false,
        dots: true,
        joined: true,
    };
    let table = Table {
        name: "learning".into(),
        caption: "Accuracy by training rows, percent; range over the folds".into(),
        columns: ["Training rows", "Accuracy"].map(String::from).to_vec(),
        rows: study
            .learning
            .iter()
            .map(|p| Row {
                source: Source::Ours,
                cells: vec![
                    Cell::Number(p.rows, format!("{:.0}", p.rows)),
                    Cell::Score(p.accuracy, Some(p.range)),
                ],
            })
            .collect(),
    };
    let section = Section {
        text: vec![
            "Models trained on growing parts of each fold's training rows (of whole groups, where \
             rows have groups), scored on its held-out rows. If the curve still rises at its \
             end, more recordings are likely to help."
                .into(),
        ],
        tables: vec![table],
        ..Section::new("learning", "Would more recordings help?")
    };
    Ok(Some(pictured(section, "learning", &plot)?))
}

/// A section with one figure.
fn pictured(section: Section, name: &str, plot: &dyn corsmal_plot::Figure) -> Result<Section> {
    Ok(Section { figures: vec![Figure::new(name, "", plot)?], ..section })
}
