//! A hash in a JSON object, of the object and of what lies beside it: damaged files are not believed.

use serde_json::Value;

/// Its key.
const HASH: &str = "hash";

/// Puts the hash of an object into it. `beside` adds what else the hash covers.
///
/// # Errors
/// A text when it is no JSON object.
pub fn seal(object: &mut Value, beside: impl FnOnce(&mut blake3::Hasher)) -> Result<(), String> {
    let hash = hash_of(&object.to_string(), beside);
    object.as_object_mut().ok_or("no JSON object")?.insert(HASH.into(), hash.into());
    Ok(())
}

/// The hash that an object has, and what it is of.
#[derive(Debug)]
pub struct Seal {
    /// Absent in files of earlier versions.
    hash: Option<Value>,
    object: String,
}

impl Seal {
    /// Takes the hash out of an object.
    pub fn take(object: &mut Value) -> Self {
        let hash = object.as_object_mut().and_then(|entries| entries.shift_remove(HASH));
        Self { hash, object: object.to_string() }
    }

    /// Refuses other content than was written.
    ///
    /// # Errors
    /// A text.
    pub fn check(&self, beside: impl FnOnce(&mut blake3::Hasher)) -> Result<(), String> {
        match &self.hash {
            Some(hash) if *hash != hash_of(&self.object, beside) => {
                Err("damaged: its content does not match the hash written with it".into())
            }
            _ => Ok(()),
        }
    }
}

fn hash_of(object: &str, beside: impl FnOnce(&mut blake3::Hasher)) -> String {
    let mut hash = blake3::Hasher::new();
    hash.update(object.as_bytes());
    beside(&mut hash);
    hash.finalize().to_hex().to_string()
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn changed_objects_are_refused() {
        let (numbers, others) = ([1, 2], [1, 3]);
        let beside = |bytes: [u8; 2]| {
            move |hash: &mut blake3::Hasher| {
                hash.update(&bytes);
            }
        };
        let mut object = json!({"rate": 0.1, "of": ["a", "b"]});
        seal(&mut object, beside(numbers)).unwrap();
        let taken = |mut object: Value| Seal::take(&mut object);
        assert_eq!(taken(object.clone()).check(beside(numbers)), Ok(()));
        assert!(taken(object.clone()).check(beside(others)).is_err());
        object["rate"] = json!(0.2);
        assert!(taken(object.clone()).check(beside(numbers)).unwrap_err().contains("damaged"));
        // As earlier versions wrote it.
        Seal::take(&mut object);
        assert_eq!(taken(object).check(beside(numbers)), Ok(()));
        assert!(seal(&mut json!([1]), beside(numbers)).is_err());
    }
}
