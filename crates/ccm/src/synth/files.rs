//! The files of a synthetic data set: notice, recordings and annotations.

use std::fmt::Write;
use std::path::Path;

use super::array::MICROPHONES;
use super::objects::{capacity_ml, container_mass_g, density};
use super::physics::SAMPLE_RATE;
use super::take::{Size, Take};
use super::views::Shape;
use crate::dataset::Subset;
use crate::error::{CcmError, Result};
use crate::scores::DensityTable;

/// The file that marks a folder as synthetic.
pub const NOTICE: &str = "SYNTHETIC.txt";

/// States that everything here is synthetic.
pub(super) fn write_notice(dir: &Path, size: Size, seed: u64, vision: bool) -> Result<()> {
    let text = format!(
        "SYNTHETIC RECORDINGS - NOT THE CORSMAL DATA SET\n\n\
         Made by `corsmal-feat synth` (size {size:?}, seed {seed}) with simple \
         physics, in the folder\n\
         layout and naming of the CORSMAL Containers Manipulation data set, for demonstrations and\n\
         tests. No real recording is in here. Scores, features and models from these files mean\n\
         nothing about the real data set or about any method evaluated on it.\n\n\
         Containers 1 to 9 have the published capacities and masses and nearly the published\n\
         dimensions; everything about containers 10 to 15 is invented.\n\n\
         train/<container>/audio/       labelled by file name\n\
         test/<container>/audio/        numbered files, labels in ccm_test_pub_annotation.csv\n\
         test_private/<container>/audio/  the same, ccm_test_priv_annotation.csv (full size only)\n\
         ccm_train_annotation.csv       official format of 2021 and later\n\
         ccm_test_*_annotation.csv      official format of 2020 (container and file number)\n\
         man_annotations.csv            start and end of the action in seconds, -1 for empty\n"
    );
    let views = "\
        calib/, rgb/, depth/           beside audio/: four views of two frames, by ray casting\n\
        detections/                    what a detector would report: boxes, labels, masks\n";
    write(&dir.join(NOTICE), (text + if vision { views } else { "" }).as_bytes())
}

/// Writes a file and the folders above it.
pub(super) fn write_new(path: &Path, bytes: &[u8]) -> Result<()> {
    if let Some(parent) = path.parent() {
        std::fs::create_dir_all(parent).map_err(|e| CcmError::io(parent, e))?;
    }
    write(path, bytes)
}

/// Writes interleaved PCM16; the file appears only when complete.
pub(super) fn write_wav(path: &Path, pcm: &[i16]) -> Result<()> {
    let spec = hound::WavSpec {
        channels: MICROPHONES as u16,
        sample_rate: SAMPLE_RATE,
        bits_per_sample: 16,
        sample_format: hound::SampleFormat::Int,
    };
    let mut bytes = std::io::Cursor::new(Vec::with_capacity(pcm.len() * 2 + 128));
    let encoded = hound::WavWriter::new(&mut bytes, spec).and_then(|mut writer| {
        let mut block = writer.get_i16_writer(pcm.len() as u32);
        pcm.iter().for_each(|&sample| block.write_sample(sample));
        block.flush()?;
        writer.finalize()
    });
    encoded.map_err(|e| CcmError::Request(format!("{}: {e}", path.display())))?;
    write_new(path, bytes.get_ref())
}

/// Writes the annotation files of the parts that have recordings.
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

fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    corsmal_files::draft::write(path, bytes).map_err(CcmError::Write)
}
