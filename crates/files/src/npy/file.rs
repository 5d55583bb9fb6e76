//! A file of one array.

use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

use ndarray::ArrayD;

use super::{Header, NpyError, array, components};

/// An open `.npy` file.
#[derive(Debug)]
pub struct NpyFile {
    path: PathBuf,
    header: Header,
}

impl NpyFile {
    /// Reads the header of a file, and compares its shape with the bytes after it.
    ///
    /// # Errors
    /// [`NpyError`].
    pub fn open(path: &Path) -> Result<Self, NpyError> {
        let file = File::open(path)?;
        let length = file.metadata()?.len();
        let (header, start) = Header::read(&mut BufReader::new(file))?;
        let data = header.data_len()?;
        if start.checked_add(data) != Some(length) {
            let expected = format!("{data} bytes of data for shape {:?}", header.shape);
            let actual = length.saturating_sub(start).to_string();
            return Err(NpyError::Malformed { offset: start, expected, actual });
        }
        Ok(Self { path: path.into(), header })
    }

    /// The file that was opened.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Type, order and shape of the array.
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// The array as 64-bit floats, complex numbers as an additional first axis of real and imaginary
    /// parts.
    ///
    /// # Errors
    /// [`NpyError`]; text is refused.
    pub fn components(&self) -> Result<ArrayD<f64>, NpyError> {
        components(&mut self.body()?, &self.header)
    }

    /// An array of whole numbers or truth values, exactly.
    ///
    /// # Errors
    /// [`NpyError`]; floats and text are refused.
    pub fn integers(&self) -> Result<ArrayD<i128>, NpyError> {
        array(&mut self.body()?, &self.header)
    }

    fn body(&self) -> Result<BufReader<File>, NpyError> {
        let mut body = BufReader::new(File::open(&self.path)?);
        Header::read(&mut body)?;
        Ok(body)
    }
}
