//! The times of stretches, and labels that look like them.

use corsmal_files::quote::quoted;

/// Column of the start of a stretch, in seconds.
pub(crate) const START: &str = "start";
/// Column of the end of a stretch, in seconds.
pub(crate) const END: &str = "end";

/// What a column of another program holds by its name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Role {
    Start,
    End,
    Length,
    /// The end beside an onset, the start beside a length.
    Offset,
}

/// Names without blanks, units and punctuation.
const ROLES: [(Role, &[&str]); 4] = [
    (
        Role::Start,
        &[
            "start",
            "starttime",
            "timestart",
            "tstart",
            "tmin",
            "begin",
            "begintime",
            "onset",
            "onsettime",
        ],
    ),
    (
        Role::End,
        &[
            "end",
            "endtime",
            "timeend",
            "tend",
            "tmax",
            "stop",
            "stoptime",
            "tstop",
            "finish",
            "finishtime",
            "offsettime",
        ],
    ),
    (Role::Length, &["duration", "dur", "length", "len", "seconds", "secs"]),
    (Role::Offset, &["offset"]),
];

/// Units that names end with.
const UNITS: [&str; 6] = ["seconds", "secs", "sec", "s", "milliseconds", "ms"];

impl Role {
    /// What a column holds, where its name tells.
    pub(crate) fn of(name: &str) -> Option<Self> {
        let name = name.to_lowercase();
        let before_unit = name.split(['(', '[']).next().unwrap_or_default();
        let plain: String = before_unit.chars().filter(|c| c.is_alphanumeric()).collect();
        let find = |plain: &str| {
            ROLES.into_iter().find(|(_, names)| names.contains(&plain)).map(|(role, _)| role)
        };
        let without = |unit: &&str| find(plain.strip_suffix(*unit)?);
        find(&plain).or_else(|| UNITS.iter().find_map(without))
    }
}

/// Whether a label may be a time.
pub(crate) fn is_number(value: &str) -> bool {
    value.trim().parse::<f64>().is_ok_and(f64::is_finite)
}

/// Which times of a stretch a row has in the columns `start` and `end`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Given {
    /// There is such a column.
    pub any_column: bool,
    /// The row has a start.
    pub start: bool,
    /// The row has an end.
    pub end: bool,
}

/// As [`refusal_of`], by the names of columns in which the row has numbers.
pub fn times_refusal(given: Given, names: &[&str]) -> Option<String> {
    let others: Vec<_> = names.iter().filter_map(|name| Some((*name, Role::of(name)?))).collect();
    refusal_of(given, &others)
}

/// Why a stretch would be another than meant, such as all that follows a `start` where a column has the
/// duration, or a whole recording where two columns have the times. `others` are columns with numbers.
pub(crate) fn refusal_of(given: Given, others: &[(&str, Role)]) -> Option<String> {
    use Role::{End, Length, Offset, Start};
    let first = |roles: &[Role]| {
        let is_one = |(_, role): &&(&str, Role)| roles.contains(role);
        others.iter().find(is_one).map(|(name, _)| *name)
    };
    let (one, other) = match (given.start, given.end) {
        (true, true) => return None,
        (true, false) => (START, first(&[End, Length, Offset])?),
        (false, true) => (first(&[Start, Offset, Length])?, END),
        (false, false) if given.any_column => return None,
        (false, false) => {
            let pair = first(&[Start]).zip(first(&[End, Length, Offset]));
            let (one, other) = pair.or_else(|| first(&[Offset]).zip(first(&[Length])))?;
            return Some(refusal(one, other, "these are labels, give them other names"));
        }
    };
    let label = if given.start { other } else { one };
    Some(refusal(one, other, &format!("{} is a label, give it another name", quoted(label))))
}

fn refusal(one: &str, other: &str, remedy: &str) -> String {
    format!(
        "columns {} and {}: the times of stretches are read from columns `{START}` and `{END}`, in seconds; if {remedy}",
        quoted(one),
        quoted(other)
    )
}

/// That these labels look like the times of stretches, where nothing is cut.
pub(super) fn unused_times<'n>(labels: impl Iterator<Item = &'n str> + Clone) -> Option<String> {
    let listed = |is_one: &dyn Fn(&str) -> bool| -> Option<String> {
        let names: Vec<&str> = labels.clone().filter(|name| is_one(name)).collect();
        match names.as_slice() {
            [] => None,
            [only] => Some(format!("the column {only} is a label")),
            several => Some(format!("the columns {} are labels", several.join(", "))),
        }
    };
    // Those of a manifest are no labels.
    let is_own = |name: &str| [START, END].contains(&name);
    let is_time = |name: &str| !is_own(name) && Role::of(name).is_some_and(|r| r != Role::Length);
    let of_tar = listed(&is_own).map(|columns| {
        format!(
            "{columns}, because a tar has no stretches: whole recordings are read; put the recordings into files and \
             list them in a manifest"
        )
    });
    let others = listed(&is_time).map(|columns| {
        format!(
            "{columns}, so whole recordings are read: to read stretches, use columns called `start` and `end` in a \
             manifest, in seconds"
        )
    });
    let told: Vec<String> = of_tar.into_iter().chain(others).collect();
    (!told.is_empty()).then(|| told.join("; "))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows with a start and a duration were read to the end of the recording.
    #[test]
    fn half_of_a_stretch_under_another_name_is_refused() {
        let refused = |start: bool, end: bool, names: &[&str]| {
            times_refusal(Given { any_column: start || end, start, end }, names)
        };
        for name in [
            "duration",
            "Stop",
            "end_time",
            "end_s",
            "end_sec",
            "stop_s",
            "t_end",
            "finish",
            "endtime",
            "seconds",
            "End Time (s)",
            "length [s]",
            "offset",
            "dur_ms",
        ] {
            let reason = refused(true, false, &["x", name]).unwrap();
            assert!(reason.contains("\"start\" and") && reason.contains(name), "{reason}");
            assert!(reason.ends_with(&format!("if \"{name}\" is a label, give it another name")));
        }
        for name in ["onset", "Begin", "start_time", "Begin Time (s)", "offset", "duration", "dur"]
        {
            let reason = refused(false, true, &[name]).unwrap();
            assert!(reason.contains("and \"end\"") && reason.contains(name), "{reason}");
        }
        for pair in [
            ["onset", "offset"],
            ["offset", "duration"],
            ["start_time", "end_time"],
            ["start_time", "duration"],
            ["duration", "onset"],
        ] {
            assert!(refused(false, false, &pair).unwrap().contains("give them other names"));
        }
        assert_eq!(refused(true, false, &["person", "count"]), None);
        assert_eq!(refused(true, true, &["duration", "onset", "offset"]), None);
        for names in [["duration", "length"], ["offset", "x"], ["onset", "x"], ["stop", "end_time"]]
        {
            assert_eq!(refused(false, false, &names), None);
        }
        // A list with `start` and `end` may have whole recordings, too.
        let whole = Given { any_column: true, start: false, end: false };
        assert_eq!(times_refusal(whole, &["onset", "offset"]), None);
    }

    /// The JSON of a recording in a tar had them, and nothing was said.
    #[test]
    fn labels_that_look_like_times_are_said() {
        let said = |names: &[&str]| unused_times(names.iter().copied());
        assert_eq!(said(&["class", "duration"]), None);
        assert!(said(&["onset"]).unwrap().starts_with("the column onset is a label, so whole"));
        let tar = said(&["start", "class", "end"]).unwrap();
        assert!(
            tar.starts_with("the columns start, end are labels, because a tar has no"),
            "{tar}"
        );
        assert!(!tar.contains("called `start`"));
        // Of a manifest beside a tar.
        let both = said(&["onset", "start"]).unwrap();
        assert!(
            both.contains("the column start is") && both.contains("the column onset is"),
            "{both}"
        );
    }
}
