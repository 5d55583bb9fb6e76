//! Annotations of a synthetic data set, in the official formats.

use std::fmt::Write;
use std::path::Path;

use super::files::write;
use super::objects::{capacity_ml, container_mass_g, density};
use super::take::Take;
use super::views::Shape;
use crate::dataset::Subset;
use crate::error::Result;
use crate::scores::DensityTable;

/// Writes the files of the parts that have recordings.
pub(super) fn write_annotations(dir: &Path, takes: &[Take]) -> Result<()> {
    let of = |subset| takes.iter().filter(move |t| t.container.subset() == subset);
    write(&dir.join("ccm_train_annotation.csv"), training(of(Subset::Training)).as_bytes())?;
    write(&dir.join("man_annotations.csv"), actions(of(Subset::Training)).as_bytes())?;
    for (subset, name) in [(Subset::Public, "pub"), (Subset::Private, "priv")] {
        let path = dir.join(format!("ccm_test_{name}_annotation.csv"));
        let mut rows: Vec<_> = of(subset).collect();
        if rows.is_empty() {
            continue;
        }
        rows.sort_by_key(|t| (t.container, t.number));
        write(&path, test(&rows).as_bytes())?;
    }
    Ok(())
}

fn filling_mass(take: &Take, densities: &DensityTable) -> f64 {
    let filling = take.name.filling;
    let average = densities
        .density(take.container.number(), filling.kind())
        .unwrap_or([0.0, 0.4, 0.85, 1.0][filling.kind() as usize]);
    (filling.level().fraction() * capacity_ml(take.container) * average).round()
}

fn training<'a>(takes: impl Iterator<Item = &'a Take>) -> String {
    let mut text = String::from(
        "id,container id,scenario,background,illumination,width at the top,width at the bottom,\
         height,depth,container capacity,container mass,filling type,filling level,\
         filling density,filling mass,object mass,handover starting frame,\
         handover start timestamp,handover hand\n",
    );
    let densities = DensityTable::average_2020();
    for (id, take) in takes.enumerate() {
        let (name, filling) = (take.name, take.name.filling);
        let (capacity, mass) = (capacity_ml(take.container), container_mass_g(take.container));
        let size = Shape::of(take.container).dimensions();
        let filled = filling_mass(take, &densities);
        let _ = writeln!(
            text,
            "{id},{},{},{},{},{},{},{},-1,{capacity},{mass},{},{},{},{filled},{},-1,-1,-1",
            take.container.number(),
            name.scenario,
            name.background,
            name.illumination,
            size.width_top,
            size.width_bottom,
            size.height,
            filling.kind() as u8,
            filling.level() as u8,
            density(filling),
            mass + filled,
        );
    }
    text
}

fn test(takes: &[&Take]) -> String {
    let mut text = String::from(
        "Container ID,Sequence,Scenario,Background,Illumination,Container Capacity [mL],\
         Container mass [g],Filling type,Filling density [g/mL],Filling level,Filling mass [g]\n",
    );
    let densities = DensityTable::average_2020();
    for take in takes {
        let (name, filling) = (take.name, take.name.filling);
        let _ = writeln!(
            text,
            "{},{},s{},b{},l{},{},{},{},{},{},{}",
            take.container.number(),
            take.number,
            name.scenario,
            name.background,
            name.illumination,
            capacity_ml(take.container),
            container_mass_g(take.container),
            filling.kind() as u8,
            density(filling),
            [0, 50, 90][filling.level() as usize],
            filling_mass(take, &densities),
        );
    }
    text
}

fn actions<'a>(takes: impl Iterator<Item = &'a Take>) -> String {
    let mut text = String::from("folder_num,file_name,start,end\n");
    for take in takes {
        let (container, name) = (take.container.number(), take.name);
        let _ = match take.action {
            Some((start, end)) => {
                writeln!(text, "{container},{name}_c2,{start:.2},{end:.2}")
            }
            None => writeln!(text, "{container},{name}_c2,-1,-1"),
        };
    }
    text
}
