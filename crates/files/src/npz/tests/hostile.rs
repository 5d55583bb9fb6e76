//! Files that lie about what they hold.

use super::*;

#[test]
fn sizes_that_lie_are_refused_before_anything_is_allocated() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("a.npz");
    let mut writer = NpzWriter::create(&path, Compression::Deflated).unwrap();
    writer.floats("x", &[100], &ramp(100)).unwrap();
    writer.finish().unwrap();
    let mut bytes = fs::read(&path).unwrap();
    let central = bytes.windows(4).position(|w| w == b"PK\x01\x02").unwrap();
    // Uncompressed size in the central directory: 3 GiB out of some hundred bytes.
    bytes[central + 24..central + 28].copy_from_slice(&(3u32 << 30).to_le_bytes());
    fs::write(&path, &bytes).unwrap();
    let error = NpzFile::open(&path).unwrap().f32("x").unwrap_err().to_string();
    assert!(error.contains("at most 134217728 bytes uncompressed"), "{error}");

    foreign(&path, &Header::new(DType::F64, &[1 << 20]), &[0; 64]);
    let error = NpzFile::open(&path).unwrap().f32("x").unwrap_err().to_string();
    assert!(
        error.contains("expected 8388608 bytes of data for shape [1048576], found 64"),
        "{error}"
    );
}

/// What the writer makes is read, however long its silence is, and has the same bytes however it
/// arrives.
#[test]
fn long_silence_is_written_so_that_it_can_be_read() {
    let folder = TempDir::new().unwrap();
    let count = 35 << 20;
    let header = Header::new(DType::F32, &[count]);
    let files = [1 << 16, (5 << 20) + 4].map(|piece: usize| {
        let path = folder.path().join(format!("{piece}.npz"));
        let mut writer = NpzWriter::create(&path, Compression::Deflated).unwrap();
        let zeros = vec![0; piece];
        let put = |out: &mut dyn Write| {
            let mut left = 4 * count;
            while left > 0 {
                let next = piece.min(left);
                out.write_all(&zeros[..next])?;
                left -= next;
            }
            Ok(())
        };
        writer.array_with("x", &header, put).unwrap();
        writer.finish().unwrap();
        path
    });
    let [one, other] = files.each_ref().map(|path| fs::read(path).unwrap());
    assert!(one == other);
    let mut npz = NpzFile::open(&files[0]).unwrap();
    for value in npz.f64("x").unwrap() {
        assert_eq!(value, 0.0);
    }
}

/// Zeros deflate to a thousandth: what is made of them is limited, too, however little they are.
#[test]
fn members_that_would_burst_are_refused() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("a.npz");
    let count = 24 << 20;
    let put = |descr: &str| {
        let mut writer = NpzWriter::create(&path, Compression::Deflated).unwrap();
        let header = Header::new(DType::parse(descr).unwrap(), &[count]);
        writer.array("x", &header, &vec![0; count]).unwrap();
        writer.finish().unwrap();
        NpzFile::open(&path).unwrap()
    };
    let mut npz = put("|u1");
    assert_eq!(npz.f32("x").unwrap().len(), count, "96 MiB");
    let error = npz.f64("x").unwrap_err().to_string();
    assert!(error.contains("at most 134217728 bytes in memory, found 201326592"), "{error}");
    assert!(npz.integers("x").is_err());
    let error = put("|S1").strings("x").unwrap_err().to_string();
    assert!(error.contains("bytes in memory"), "{error}");
}

#[test]
fn members_that_share_bytes_are_refused() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("a.npz");
    write(&path, Compression::Deflated);
    let bytes = fs::read(&path).unwrap();
    let central: Vec<usize> = bytes
        .windows(4)
        .enumerate()
        .filter(|(_, window)| window == b"PK\x01\x02")
        .map(|(at, _)| at)
        .collect();
    let mut shared = bytes.clone();
    // The place of the second is that of the first.
    shared.copy_within(central[0] + 42..central[0] + 46, central[1] + 42);
    fs::write(&path, shared).unwrap();
    let error = NpzFile::open(&path).unwrap_err().to_string();
    assert!(error.contains("members \"träning/0.npy\" and \"träning/1.npy\" share"), "{error}");
}

/// An archive by another writer, with a header that need not be true and a member that is not an array.
fn foreign(path: &Path, header: &Header, data: &[u8]) {
    let mut archive = ::zip::ZipWriter::new(fs::File::create(path).unwrap());
    let options = ::zip::write::SimpleFileOptions::default();
    archive.start_file("README", options).unwrap();
    archive.start_file("x.npy", options).unwrap();
    archive.write_all(&header.encode()).unwrap();
    archive.write_all(data).unwrap();
    archive.finish().unwrap();
}

#[test]
fn text_without_bytes_costs_nothing() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("a.npz");
    foreign(&path, &Header::new(DType::text(0), &[1 << 40]), &[]);
    let error = NpzFile::open(&path).unwrap().strings("x").unwrap_err().to_string();
    assert!(error.contains("shape [1099511627776] of 0-byte elements is too large"), "{error}");
    foreign(&path, &Header::new(DType::text(0), &[3]), &[]);
    let error = NpzFile::open(&path).unwrap().strings("x").unwrap_err().to_string();
    assert!(error.contains("expected text of at least one character, found <U0"), "{error}");
    // As many rows as a header likes, without columns.
    foreign(&path, &Header::new(DType::F64, &[1 << 60, 0]), &[]);
    let error = NpzFile::open(&path).unwrap().f64("x").unwrap_err().to_string();
    assert!(error.contains("of 8-byte elements is too large"), "{error}");
    foreign(&path, &Header::new(DType::F64, &[1000, 0]), &[]);
    assert_eq!(NpzFile::open(&path).unwrap().f64("x").unwrap().shape(), [1000, 0]);
    foreign(&path, &Header::new(DType::text(1 << 26), &[0]), &[]);
    let mut npz = NpzFile::open(&path).unwrap();
    assert_eq!(npz.names(), ["x"]);
    assert!(npz.strings("x").unwrap().is_empty());
}

proptest! {
    #[test]
    fn any_damage_gives_an_answer(
        edits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
        cut in any::<prop::sample::Index>(),
        deflated in any::<bool>(),
    ) {
        let folder = TempDir::new().unwrap();
        let path = folder.path().join("a.npz");
        let mut writer = NpzWriter::create(&path, COMPRESSIONS[usize::from(deflated)]).unwrap();
        writer.floats("x", &[3, 2], &ramp(6)).unwrap();
        writer.strings("s", &["a", "bc"]).unwrap();
        writer.finish().unwrap();
        let mut bytes = fs::read(&path).unwrap();
        for (at, byte) in edits {
            let at = at.index(bytes.len());
            bytes[at] = byte;
        }
        bytes.truncate(bytes.len() - cut.index(bytes.len()) / 8);
        fs::write(&path, &bytes).unwrap();
        if let Ok(mut npz) = NpzFile::open(&path) {
            for name in npz.names().to_vec() {
                let _ = (npz.f32(&name), npz.strings(&name), npz.text(&name), npz.header(&name));
            }
        }
    }
}
