//! Expands `{000..012}` and `{a,b}` in names, as shells do: WebDataset's way to name shards.

use super::error::InputError;

/// Most names that one pattern stands for.
const MOST: usize = 1 << 20;

/// The names that a pattern stands for, in order; `None` where it has no braces that a shell would
/// expand.
///
/// # Errors
/// Too many names.
pub(super) fn expand(pattern: &str) -> Result<Option<Vec<String>>, InputError> {
    let mut names = vec![String::new()];
    let (mut rest, mut expanded) = (pattern, false);
    while let Some((before, group, after)) = next(rest) {
        let choices = choices(group, pattern)?;
        expanded |= choices.is_some();
        let choices = choices.unwrap_or_else(|| vec![format!("{{{group}}}")]);
        if names.len().saturating_mul(choices.len()) > MOST {
            return Err(too_many(pattern));
        }
        names = names
            .iter()
            .flat_map(|name| choices.iter().map(move |choice| format!("{name}{before}{choice}")))
            .collect();
        rest = after;
    }
    names.iter_mut().for_each(|name| name.push_str(rest));
    Ok(expanded.then_some(names))
}

fn next(text: &str) -> Option<(&str, &str, &str)> {
    let (before, rest) = text.split_once('{')?;
    let (group, after) = rest.split_once('}')?;
    Some((before, group, after))
}

fn choices(group: &str, pattern: &str) -> Result<Option<Vec<String>>, InputError> {
    if let Some((first, last)) = group.split_once("..") {
        let is_number = |text: &str| !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit());
        let (Ok(from), Ok(to)) = (first.parse::<usize>(), last.parse::<usize>()) else {
            return Ok(None);
        };
        if !is_number(first) || !is_number(last) || from > to {
            return Ok(None);
        }
        if to - from >= MOST {
            return Err(too_many(pattern));
        }
        let is_padded = [first, last].iter().any(|text| text.len() > 1 && text.starts_with('0'));
        let width = if is_padded { first.len().max(last.len()) } else { 0 };
        return Ok(Some((from..=to).map(|number| format!("{number:0width$}")).collect()));
    }
    Ok(group.contains(',').then(|| group.split(',').map(String::from).collect()))
}

fn too_many(pattern: &str) -> InputError {
    let reason = format!("expands to more than {MOST} names");
    InputError::Glob { pattern: pattern.into(), reason }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(pattern: &str) -> Option<Vec<String>> {
        expand(pattern).unwrap()
    }

    #[test]
    fn ranges_and_lists_are_expanded_as_in_a_shell() {
        assert_eq!(
            names("s/{008..011}.tar").unwrap(),
            ["s/008.tar", "s/009.tar", "s/010.tar", "s/011.tar"]
        );
        assert_eq!(names("{9..10}").unwrap(), ["9", "10"]);
        assert_eq!(names("{a,b}-{1..2}x").unwrap(), ["a-1x", "a-2x", "b-1x", "b-2x"]);
    }

    #[test]
    fn what_a_shell_leaves_stays() {
        for pattern in ["a.wav", "{a}.wav", "{3..1}", "{a..c}", "{}", "{1..", "x}", "{+1..2}"] {
            assert_eq!(names(pattern), None, "{pattern}");
        }
        assert_eq!(names("{a}{1,2}").unwrap(), ["{a}1", "{a}2"]);
        for pattern in ["{0..99999999999}", "{1..1024}{1..1025}"] {
            assert!(expand(pattern).is_err(), "{pattern}");
        }
    }
}
