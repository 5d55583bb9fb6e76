//! Whose rules, and what they score.

/// Whose rules to score by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RuleSet {
    /// The equations of the paper.
    Paper,
    /// Official evaluator of October 2020 (commit acaa7a0).
    Toolkit202010,
    /// Official evaluator of November 2021 (commit 9087f46), which the README table belongs to.
    Toolkit202111,
    /// Current official evaluator (commit 3e689d8).
    Toolkit,
}

impl RuleSet {
    /// All rule sets.
    pub const ALL: [Self; 4] =
        [Self::Paper, Self::Toolkit202010, Self::Toolkit202111, Self::Toolkit];

    /// Name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Paper => "paper",
            Self::Toolkit202010 => "toolkit-2020-10",
            Self::Toolkit202111 => "toolkit-2021-11",
            Self::Toolkit => "toolkit",
        }
    }
}

/// Scores in percent under one rule set.
#[derive(Clone, Debug, PartialEq)]
pub struct Scores {
    /// The rules.
    pub rules: RuleSet,
    /// Number of recordings scored.
    pub rows: usize,
    /// Name and value of each score: `s1` to `s10`, `overall`, `JFLT`, `CMD` by the toolkit of 2021
    /// and later; `T1`, `T2`, `T3`, `mass`, `joint` and, where both masses are estimated, the mean
    /// error of the object's weight in N by the paper; the first four by the toolkit of 2020.
    pub values: Vec<(&'static str, f64)>,
    /// What a reader of the scores should know.
    pub notes: Vec<String>,
}

impl Scores {
    /// A score by name.
    pub fn get(&self, name: &str) -> Option<f64> {
        self.values.iter().find(|(n, _)| *n == name).map(|(_, v)| *v)
    }
}

impl RuleSet {
    /// What the scores of these rules are about, by name.
    pub fn legend(self) -> &'static [(&'static str, &'static str)] {
        match self {
            Self::Paper => &[
                ("T1", "filling level, weighted F1"),
                ("T2", "filling type, weighted F1"),
                ("T3", "container capacity"),
                ("mass", "filling mass"),
                ("joint", "joint filling type and level, weighted F1"),
                ("weight_error_N", "mean error of the weight, newtons"),
            ],
            Self::Toolkit202010 => &[
                ("T1", "filling level, weighted F1"),
                ("T2", "filling type, weighted F1"),
                ("T3", "container capacity"),
                ("mass", "filling mass"),
            ],
            Self::Toolkit202111 | Self::Toolkit => &[
                ("s1", "filling level, weighted F1"),
                ("s2", "filling type, weighted F1"),
                ("s3", "container capacity"),
                ("s4", "width at the top"),
                ("s5", "width at the bottom"),
                ("s6", "height"),
                ("s7", "container mass"),
                ("s8", "filling mass"),
                ("s9", "object safety"),
                ("s10", "delivery accuracy"),
                ("overall", "all of these"),
                ("JFLT", "joint filling level and type"),
                ("CMD", "capacity and dimensions"),
            ],
        }
    }
}
