//! What a comparison found.

use std::collections::HashMap;

use ndarray::{Array3, ArrayD};
use serde::Serialize;

use super::causes::{self, Cause};
use super::compared_file::{ArrayEntry, ComparedFile, Refused};
use super::difference::{Difference, Limit, Tolerance};
use super::matching::{ArrayMatch, Matching, TableMatch};
use super::pair::{Axes, Pair, index_of};
use super::pairing::PairedBy;
use super::settings::Settings;
use super::texts::{self, TextReport};
use corsmal_files::parquet::NumericTable;

/// The differences between two files.
#[derive(Debug, Serialize)]
pub struct Comparison {
    /// The first file.
    pub a: FileReport,
    /// The second file.
    pub b: FileReport,
    /// Whether everything that could be compared is equal under the tolerance and nothing in common
    /// was left out.
    pub within: bool,
    /// What recordings were paired by.
    pub paired_by: PairedBy,
    /// How many rows of arrays of other programs were paired by arrays `id` or `ids` beside them; 0 where these have
    /// nothing in common, null where rows of the same number belong together.
    pub paired_rows: Option<usize>,
    /// Configurations, where both files are outputs of ours.
    pub settings: Option<Settings>,
    /// One entry per feature, or per array of files that are not ours.
    pub features: Vec<FeatureReport>,
    /// Labels, statuses, texts and whole numbers beyond 2^53 that both files have, compared exactly.
    pub texts: Vec<TextReport>,
    /// Arrays, columns and rows of the first file only.
    pub only_a: Vec<String>,
    /// Arrays, columns and rows of the second file only.
    pub only_b: Vec<String>,
    /// Arrays of both files that could not be read in one of them.
    pub refused: Vec<Refused>,
}

/// One of the files.
#[derive(Debug, Serialize)]
pub struct FileReport {
    /// Where it is.
    pub path: String,
    /// `npz`, `npy` or `parquet`.
    pub format: &'static str,
    /// Version of the tool that wrote it, where it is ours.
    pub tool_version: Option<String>,
}

/// Two arrays of different shapes.
#[derive(Debug, Serialize)]
pub struct Shapes {
    /// Recording or array.
    pub array: String,
    /// Shape in the first file.
    pub a: Vec<usize>,
    /// Shape in the second.
    pub b: Vec<usize>,
}

/// A likely cause, in how many arrays it was found, and its evidence in the first of them.
#[derive(Debug, Serialize)]
pub struct Finding {
    /// Arrays in which it was found.
    pub arrays: usize,
    /// The first of them.
    pub array: String,
    /// The cause there.
    #[serde(flatten)]
    pub cause: Cause,
}

/// Differences of one feature over all recordings.
#[derive(Debug, Serialize)]
pub struct FeatureReport {
    /// The feature, or the array.
    pub feature: String,
    /// Arrays in common; of tables, rows.
    pub arrays: usize,
    /// Those in which a value differs by more than the tolerance, or the shape.
    pub differing: usize,
    /// Element types of the first arrays met.
    pub dtypes: [String; 2],
    /// Arrays whose shapes differ; their values are not compared.
    pub shapes: Vec<Shapes>,
    /// Over the arrays whose shapes agree.
    #[serde(flatten)]
    pub difference: Difference,
    /// What probably caused the differences.
    pub causes: Vec<Finding>,
}

/// Puts a report together, a pair at a time.
pub(super) struct ComparisonBuilder {
    tolerance: Tolerance,
    exact: Vec<TextReport>,
    features: Vec<FeatureReport>,
    places: HashMap<String, usize>,
    /// Recordings in which each feature differs, in the order of the features.
    differing: Vec<Vec<String>>,
}

impl ComparisonBuilder {
    pub(super) fn new(tolerance: Tolerance) -> Self {
        let (exact, features, differing) = (Vec::new(), Vec::new(), Vec::new());
        Self { tolerance, exact, features, places: HashMap::new(), differing }
    }

    /// Compares two arrays.
    pub(super) fn arrays(
        &mut self,
        found: &ArrayMatch,
        a: &ArrayEntry,
        b: &ArrayEntry,
        (x, y): (ArrayD<f64>, ArrayD<f64>),
    ) {
        let dtypes = [a.dtype.as_str(), b.dtype.as_str()];
        let tolerance = self.tolerance;
        let feature = self.feature(&found.feature, dtypes);
        feature.arrays += 1;
        let (shape, other) = (x.shape().to_vec(), y.shape().to_vec());
        // The parts of complex numbers are no channels, which causes are looked for in.
        let complex = dtypes.map(is_complex);
        let pair = match Pair::new(x, y) {
            Ok(pair) if complex[0] == complex[1] => pair,
            arrays => {
                let [x, y] = match arrays {
                    Ok(Pair { a, b, .. }) => [a.into_dyn(), b.into_dyn()],
                    Err(arrays) => *arrays,
                };
                let array = found.place.clone();
                let own = |shape: &[usize], complex| shape[usize::from(complex)..].to_vec();
                let (a, b) = (own(&shape, complex[0]), own(&other, complex[1]));
                feature.shapes.push(Shapes { array, a, b });
                feature.differing += 1;
                if complex == [false; 2] {
                    feature.causes(causes::of_shapes(x, y), &found.place);
                }
                self.differs(&found.feature, [found.place.clone()]);
                return;
            }
        };
        let ours = a.ours.is_some() || b.ours.is_some();
        let locate = |ordinal| {
            let mut index = index_of(ordinal, &shape);
            if let Some(place) = index.get_mut(usize::from(complex[0])) {
                *place = found.rows.get(*place).copied().unwrap_or(*place);
            }
            (found.place.clone(), position(&index, ours), index)
        };
        let limit = tolerance.limit(pair.largest());
        let before = feature.difference.values - feature.difference.within;
        let equal = feature.difference.values - feature.difference.equal;
        feature.difference.add(pair.values(), |_| limit, locate);
        let apart = feature.difference.values - feature.difference.within;
        feature.differing += usize::from(apart > before);
        if feature.difference.values - feature.difference.equal > equal {
            let mut found_causes = causes::of_values(&pair, dtypes);
            if complex[0] {
                let of_channels = |text: &str| text.contains("channel");
                found_causes.retain(|c| !of_channels(&c.cause) && !of_channels(&c.evidence));
            }
            feature.causes(found_causes, &found.place);
        }
        if apart > before {
            self.differs(&found.feature, [found.place.clone()]);
        }
    }

    /// Compares whole numbers that doubles would round, exactly; `false` if the arrays are of other shapes.
    pub(super) fn integers(
        &mut self,
        found: &ArrayMatch,
        a: &ArrayD<i128>,
        b: &ArrayD<i128>,
    ) -> bool {
        let same = a.shape() == b.shape();
        if same {
            self.exact.push(TextReport::of_integers(&found.place, a.iter().zip(b)));
        }
        same
    }

    /// Compares the common rows and columns of two tables. Without tables nothing was found.
    pub(super) fn table(
        &mut self,
        found: &TableMatch,
        a: Option<&NumericTable>,
        b: Option<&NumericTable>,
    ) {
        let (Some(a), Some(b)) = (a, b) else { return };
        let shape = (1, found.columns.len(), found.rows.len());
        let pair = Pair {
            a: Array3::from_shape_fn(shape, |(_, column, row)| {
                a.values[(found.rows[row].0, found.columns[column].0)]
            }),
            b: Array3::from_shape_fn(shape, |(_, column, row)| {
                b.values[(found.rows[row].1, found.columns[column].1)]
            }),
            axes: Axes::Table,
        };
        let scales = pair.scales(&found.vectors);
        let limits: Vec<Limit> = scales.iter().map(|most| self.tolerance.limit(*most)).collect();
        let rows = found.row_names(a);
        let feature = self.feature(&found.feature, ["table", "table"]);
        feature.arrays += rows.len();
        let differs = |row: usize| {
            let column = |side: &Array3<f64>| side.slice(ndarray::s![0, .., row]).to_owned();
            let [x, y] = [column(&pair.a), column(&pair.b)];
            x.iter().zip(&y).zip(&limits).any(|((x, y), limit)| !limit.holds(*x, *y))
        };
        let apart: Vec<String> =
            (0..rows.len()).filter(|&row| differs(row)).map(|row| rows[row].clone()).collect();
        feature.differing += apart.len();
        let locate = |ordinal| {
            let index = index_of(ordinal, &[shape.1, shape.2]);
            let column = &a.names[found.columns[index[0]].0];
            (rows[index[1]].clone(), column.clone(), vec![index[1], index[0]])
        };
        feature.difference.add(pair.values(), |ordinal| limits[ordinal / shape.2], locate);
        if feature.difference.equal < feature.difference.values {
            // Beside a large column, differences of a small one would pass for rounding.
            let is_hidden = !apart.is_empty() && pair.is_noise();
            let pair = if is_hidden { pair.relative_to(&scales) } else { pair };
            feature.causes(causes::of_values(&pair, ["table", "table"]), "the table");
        }
        self.differs(&found.feature, apart);
    }

    /// Notes recordings in which a feature differs.
    fn differs(&mut self, feature: &str, places: impl IntoIterator<Item = String>) {
        if let Some(at) = self.places.get(feature) {
            self.differing[*at].extend(places);
        }
    }

    /// The report, with what the files hold beside.
    pub(super) fn finish(
        mut self,
        a: &ComparedFile,
        b: &ComparedFile,
        matching: Matching,
    ) -> Comparison {
        let named = |file: &ComparedFile, name: &str| file.arrays().iter().any(|e| e.name == name);
        let refused_in = |file: &ComparedFile, name: &str| {
            file.refused().iter().any(|refused| refused.array == name)
        };
        let both = |of: &ComparedFile, other: &ComparedFile| -> Vec<Refused> {
            let common = |r: &&Refused| named(other, &r.array) || refused_in(other, &r.array);
            let name = of.path().display();
            of.refused()
                .iter()
                .filter(common)
                .map(|r| Refused {
                    array: r.array.clone(),
                    reason: format!("{name}: {}", r.reason),
                })
                .collect()
        };
        let mut refused = both(a, b);
        refused.extend(both(b, a).into_iter().filter(|r| !refused_in(a, &r.array)));
        let settings = match (a.provenance(), b.provenance()) {
            (Some(of_a), Some(of_b)) => {
                let contents = texts::contents(a.identities(), b.identities(), matching.paired_by);
                Some(Settings::new(of_a, of_b, contents))
            }
            _ => None,
        };
        let others = a.identities().other(b.identities(), matching.paired_by);
        for (feature, differing) in self.features.iter_mut().zip(&self.differing) {
            let Some(settings) = &settings else { continue };
            if feature.differing == 0 || !feature.causes.is_empty() {
                continue;
            }
            let mut add = |array: &str, arrays: usize, cause: Option<Cause>| {
                let array = array.into();
                feature.causes.extend(cause.map(|cause| Finding { arrays, array, cause }));
            };
            let other = differing.iter().filter(|place| others.contains(*place)).count();
            add("the recordings", other, causes::of_contents(other, differing.len()));
            let of_settings = causes::of_settings(settings, &feature.feature);
            add("the configurations", differing.len(), of_settings);
        }
        for feature in &mut self.features {
            // What differs has more to say than what is only rounded.
            feature.causes.sort_by_key(|found| found.cause.kind == causes::CauseKind::Rounding);
        }
        let equal = |f: &FeatureReport| f.differing == 0;
        let mut texts = self.exact;
        texts.extend(texts::compare(
            (a.texts(), a.identities()),
            (b.texts(), b.identities()),
            matching.paired_by,
        ));
        Comparison {
            a: FileReport::new(a),
            b: FileReport::new(b),
            within: self.features.iter().all(equal)
                && texts.iter().all(|t| t.differing == 0)
                && matching.only_a.is_empty()
                && matching.only_b.is_empty()
                && refused.is_empty(),
            paired_by: matching.paired_by,
            paired_rows: matching.paired_rows,
            settings,
            features: self.features,
            texts,
            only_a: matching.only_a,
            only_b: matching.only_b,
            refused,
        }
    }

    fn feature(&mut self, name: &str, dtypes: [&str; 2]) -> &mut FeatureReport {
        let next = self.features.len();
        let place = *self.places.entry(name.to_string()).or_insert(next);
        if place == next {
            self.differing.push(Vec::new());
            self.features.push(FeatureReport {
                feature: name.into(),
                arrays: 0,
                differing: 0,
                dtypes: dtypes.map(str::to_string),
                shapes: Vec::new(),
                difference: Difference::default(),
                causes: Vec::new(),
            });
        }
        &mut self.features[place]
    }
}

impl FeatureReport {
    /// Counts causes; of each kind the first one's words are kept.
    fn causes(&mut self, causes: Vec<Cause>, place: &str) {
        for cause in causes {
            match self.causes.iter_mut().find(|found| found.cause.kind == cause.kind) {
                Some(found) => found.arrays += 1,
                None => self.causes.push(Finding { arrays: 1, array: place.into(), cause }),
            }
        }
    }
}

impl FileReport {
    fn new(file: &ComparedFile) -> Self {
        Self {
            path: file.path().display().to_string(),
            format: file.format(),
            tool_version: file.provenance().map(|p| p.tool_version.clone()),
        }
    }
}

/// Whether numpy's name of a type is one of complex numbers.
pub fn is_complex(dtype: &str) -> bool {
    dtype.contains('c')
}

/// A place in words: by the names of our axes, else the index.
fn position(index: &[usize], ours: bool) -> String {
    match (ours, index) {
        (true, [channel, coefficient, frame]) => {
            format!("channel {channel}, coefficient {coefficient}, frame {frame}")
        }
        (true, [frame]) => format!("frame {frame}"),
        _ => format!("{index:?}"),
    }
}
