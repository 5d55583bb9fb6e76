//! What `--cv` says about the folds.

use std::fmt;
use std::str::FromStr;

/// A plan as written by the user.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum CvPlan {
    /// `group=COLUMN`: each group once
    Group(String),
    /// `k=N` or `N`: this many folds, of whole groups where there are groups, else stratified
    K(usize),
    /// `lists=1,4,7/2,5,8`: these groups together
    Lists(Vec<Vec<String>>),
    /// `fold=COLUMN`: the column says the fold
    Fold(String),
}

impl FromStr for CvPlan {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let expected = || {
            format!(
                "{text:?}: expected a number of folds, group=COLUMN, k=N, \
                 lists=1,4,7/2,5,8/3,6,9 or fold=COLUMN"
            )
        };
        if let Ok(folds) = text.parse() {
            return Ok(Self::K(folds));
        }
        let (kind, value) = text.split_once('=').ok_or_else(expected)?;
        if value.is_empty() {
            return Err(expected());
        }
        match kind {
            "group" => Ok(Self::Group(value.into())),
            "k" => value.parse().map(Self::K).map_err(|_| expected()),
            "lists" => {
                let list = |l: &str| l.split(',').map(|g| g.trim().to_string()).collect();
                Ok(Self::Lists(value.split('/').map(list).collect()))
            }
            "fold" => Ok(Self::Fold(value.into())),
            _ => Err(expected()),
        }
    }
}

impl fmt::Display for CvPlan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Group(column) => write!(f, "each {column} once"),
            Self::K(k) => write!(f, "{k} folds"),
            Self::Lists(lists) => write!(f, "{} lists of groups", lists.len()),
            Self::Fold(column) => write!(f, "the folds of column {column}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plans_are_read_as_written() {
        let lists = vec![vec!["1".into(), "4".into()], vec!["2".into()]];
        assert_eq!("lists=1, 4/2".parse(), Ok(CvPlan::Lists(lists)));
        assert_eq!("k=3".parse(), Ok(CvPlan::K(3)));
        assert_eq!("group=container".parse(), Ok(CvPlan::Group("container".into())));
        assert_eq!("fold=fold".parse(), Ok(CvPlan::Fold("fold".into())));
        assert_eq!("5".parse(), Ok(CvPlan::K(5)));
        for wrong in ["k=", "k=x", "leave=1", "-3", ""] {
            assert!(wrong.parse::<CvPlan>().is_err(), "{wrong}");
        }
    }
}
