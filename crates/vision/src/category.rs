//! The category of a container; M3's, by vote, and the sizes of its regions in the four views.

use std::collections::BTreeMap;

use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_xoshiro::Xoshiro256PlusPlus;
use serde::{Deserialize, Serialize};

use crate::detections::Detection;

/// Share of the frames that vote.
pub const SHARE: f64 = 0.65;

/// Kind of container.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Category {
    /// Plastic or paper cup.
    Cup,
    /// Drinking glass.
    Glass,
    /// Food box: shaken, never filled with water.
    Box,
}

impl Category {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Cup, Self::Glass, Self::Box];

    /// English name in lower case.
    pub fn name(self) -> &'static str {
        match self {
            Self::Cup => "cup",
            Self::Glass => "glass",
            Self::Box => "box",
        }
    }

    /// What a detector's label stands for. COCO has no food boxes: books and suitcases are what they are
    /// taken for.
    pub fn of_label(label: &str) -> Option<Self> {
        match label {
            "cup" | "bowl" => Some(Self::Cup),
            "wine glass" | "vase" | "bottle" | "glass" => Some(Self::Glass),
            "book" | "suitcase" | "box" => Some(Self::Box),
            _ => None,
        }
    }
}

/// What the frames that vote say.
#[derive(Clone, Debug, PartialEq)]
pub struct Vote {
    /// The category with most votes; the first of equals.
    pub category: Category,
    /// Number of frames of all views that voted.
    pub frames: usize,
    /// Votes for it.
    pub votes: usize,
    /// Median of the logarithms of width and height in px of its regions, view by view; `None` where a
    /// view has none.
    pub sizes: [Option<[f64; 2]>; 4],
}

/// The vote of a random share of the frames; a frame of a view votes for its most confident container.
///
/// The same seed gives the same vote. `None` where no frame shows a container.
pub fn vote(detections: &[Detection], share: f64, seed: u64) -> Option<Vote> {
    // The most confident container of every frame of every view.
    let mut frames: BTreeMap<(u32, u8), (Category, &Detection)> = BTreeMap::new();
    for detection in detections {
        let Some(category) = Category::of_label(&detection.label) else { continue };
        let best = frames.entry((detection.frame, detection.view)).or_insert((category, detection));
        if detection.score > best.1.score {
            *best = (category, detection);
        }
    }
    let all: Vec<_> = frames.into_values().collect();
    let count = ((all.len() as f64 * share).round() as usize).clamp(1, all.len().max(1));
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
    let voters: Vec<_> = all.choose_multiple(&mut rng, count).collect();
    let votes = Category::ALL.map(|c| voters.iter().filter(|(v, _)| *v == c).count());
    let most = votes.iter().copied().max().filter(|&most| most > 0)?;
    let category = Category::ALL[votes.iter().position(|&v| v == most)?];
    let sizes = [1, 2, 3, 4].map(|view| {
        let of_view =
            || voters.iter().filter(move |(c, d)| *c == category && d.view == view).map(|(_, d)| d);
        let logs = [0, 1].map(|axis| {
            let sizes = of_view().map(|d| d.size()[axis].max(1.0).ln());
            median(sizes.collect())
        });
        logs[0].zip(logs[1]).map(|(w, h)| [w, h])
    });
    Some(Vote { category, frames: voters.len(), votes: most, sizes })
}

fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let middle = values.len() / 2;
    match values.len() {
        0 => None,
        n if n % 2 == 1 => Some(values[middle]),
        _ => Some((values[middle - 1] + values[middle]) / 2.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(rows: &[(u32, u8, &str, f64, f64)]) -> Vec<Detection> {
        let mut text = String::from("frame,view,label,score,x_min,y_min,x_max,y_max\n");
        for (frame, view, label, score, width) in rows {
            text += &format!("{frame},{view},{label},{score},0,0,{width},{}\n", 2.0 * width);
        }
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("d.csv");
        std::fs::write(&path, text).unwrap();
        crate::read_detections(&path).unwrap()
    }

    #[test]
    fn frames_vote_for_their_most_confident_container() {
        let rows = table(&[
            (0, 1, "person", 0.99, 500.0),
            (0, 1, "cup", 0.6, 40.0),
            (0, 1, "wine glass", 0.7, 50.0),
            (1, 1, "cup", 0.9, 40.0),
            (1, 2, "cup", 0.9, 90.0),
            (2, 1, "cup", 0.8, 60.0),
        ]);
        let all = vote(&rows, 1.0, 1).unwrap();
        assert_eq!((all.category, all.frames, all.votes), (Category::Cup, 4, 3));
        let logs = |w: f64, h: f64| Some([w.ln(), h.ln()]);
        let middle = (40f64.ln() + 60f64.ln()) / 2.0;
        let found = all.sizes[0].unwrap();
        assert!((found[0] - middle).abs() < 1e-12);
        assert_eq!(all.sizes[1..], [logs(90.0, 180.0), None, None]);
        let part = vote(&rows, SHARE, 1).unwrap();
        assert_eq!((part.frames, &part), (3, &vote(&rows, SHARE, 1).unwrap()));
        assert_eq!(vote(&table(&[(0, 1, "person", 0.99, 500.0)]), SHARE, 1), None);
    }
}
