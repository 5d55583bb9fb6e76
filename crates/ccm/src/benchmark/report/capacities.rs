//! How far estimated capacities are from the true ones.

use corsmal_plot::{BoxPlot, BoxRow};
use corsmal_report::{Figure, FigureGroup, Section};

use crate::benchmark::method::Method;
use crate::benchmark::names::file_name;
use crate::benchmark::results::{Rows, Target};
use crate::dataset::{Container, Filling};
use crate::error::Result;

/// Boxes of the relative error by container and by type and level, for every method that estimates capacities.
pub(super) fn section(rows: &Rows, methods: &[Method]) -> Result<Option<Section>> {
    let shown = methods.iter().filter(|m| !m.completes() && m.protocol != "published");
    let mut groups = Vec::new();
    for method in shown {
        let estimates = method.with_capacity(rows);
        if estimates.is_empty() {
            continue;
        }
        let error = |(_, truth, estimate): &(&Target, f64, f64)| 100.0 * (estimate - truth) / truth;
        let boxes = |name: &dyn Fn(&Target) -> Option<String>, names: Vec<String>| -> Vec<BoxRow> {
            let rows = names.into_iter().map(|group| {
                let own = estimates.iter().filter(|e| name(e.0).as_ref() == Some(&group));
                BoxRow { values: own.map(error).collect(), name: group }
            });
            rows.filter(|row| !row.values.is_empty()).collect()
        };
        let container = |t: &Target| t.recording.container.map(container_name);
        let containers = (1..=15).filter_map(Container::new).map(container_name).collect();
        let filling = |t: &Target| t.filling.map(Filling::name);
        let fillings = Filling::all().map(Filling::name).collect();
        let plots = [
            ("container", boxes(&container, containers)),
            ("type and level", boxes(&filling, fillings)),
        ];
        let slug = file_name(&method.name);
        let figures = plots.into_iter().filter(|(_, rows)| !rows.is_empty()).map(|(by, rows)| {
            let plot = BoxPlot {
                title: format!("{}: capacity error by {by}", method.name),
                value_label: "relative error, percent of the true capacity".into(),
                rows,
            };
            Figure::new(format!("capacity-error-{slug}-by-{}", by.replace(' ', "-")), "", &plot)
        });
        groups.push(FigureGroup {
            title: method.name.clone(),
            figures: figures.collect::<corsmal_report::Result<_>>()?,
        });
    }
    // Pseudo-random estimates alone are no result.
    if groups.iter().all(|group| group.title == "Random") {
        return Ok(None);
    }
    groups.sort_by_key(|group| group.title == "Random");
    Ok(Some(Section {
        text: vec![
            "Positive values are overestimates. Boxes hold the middle half of the recordings, \
             whiskers reach the farthest values within 1.5 times the box's length, circles are \
             those beyond. Recordings without an estimate are left out."
                .into(),
        ],
        groups,
        ..Section::new("capacity-errors", "Errors of the capacity")
    }))
}

fn container_name(container: Container) -> String {
    format!("C{}", container.number())
}
