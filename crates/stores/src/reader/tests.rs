//! The reader over a store in memory that fails as it is told.

use std::fmt;
use std::sync::Mutex;
use std::sync::atomic::Ordering;

use async_trait::async_trait;
use futures_util::StreamExt;
use futures_util::stream::{self, BoxStream};
use object_store::memory::InMemory;
use object_store::{
    CopyOptions, GetResult, GetResultPayload, ListResult, MultipartUpload, ObjectMeta,
    PutMultipartOptions, PutOptions, PutPayload, PutResult, Result as StoreResult,
};

use super::*;

/// What happens to the answer to a request.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Fault {
    /// Bytes break off with an error.
    Broken,
    /// Fewer bytes than promised come, without an error.
    Short,
    /// The object is another one from here on.
    Replaced,
    /// It is gone.
    Removed,
    /// No answer comes.
    Silent,
}

/// A store whose n-th answer has a fault.
#[derive(Debug)]
struct Faulty {
    inner: InMemory,
    faults: Mutex<Vec<Option<Fault>>>,
    asked: Mutex<Vec<Range<u64>>>,
}

impl fmt::Display for Faulty {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Faulty")
    }
}

fn broken() -> object_store::Error {
    object_store::Error::Generic { store: "Faulty", source: "connection reset".into() }
}

#[async_trait]
impl ObjectStore for Faulty {
    async fn get_opts(&self, location: &Path, options: GetOptions) -> StoreResult<GetResult> {
        if let Some(GetRange::Bounded(range)) = &options.range {
            self.asked.lock().unwrap().push(range.clone());
        }
        let fault = {
            let mut faults = self.faults.lock().unwrap();
            if faults.is_empty() || options.head { None } else { faults.remove(0) }
        };
        match fault {
            Some(Fault::Replaced) => {
                let size = self.inner.head(location).await?.size as usize;
                self.inner.put(location, vec![9_u8; size].into()).await?;
            }
            Some(Fault::Removed) => self.inner.delete(location).await?,
            Some(Fault::Silent) => std::future::pending::<()>().await,
            _ => {}
        }
        let mut answer = self.inner.get_opts(location, options).await?;
        if let Some(fault @ (Fault::Broken | Fault::Short)) = fault {
            let (meta, range) = (answer.meta.clone(), answer.range.clone());
            let bytes = answer.bytes().await?;
            let half = bytes.slice(..bytes.len() / 2);
            let mut parts = vec![Ok(half)];
            if fault == Fault::Broken {
                parts.push(Err(broken()));
            }
            answer = GetResult {
                payload: GetResultPayload::Stream(stream::iter(parts).boxed()),
                meta,
                range,
                attributes: Default::default(),
                extensions: Default::default(),
            };
        }
        Ok(answer)
    }

    async fn put_opts(&self, _: &Path, _: PutPayload, _: PutOptions) -> StoreResult<PutResult> {
        Err(broken())
    }

    async fn put_multipart_opts(
        &self,
        _: &Path,
        _: PutMultipartOptions,
    ) -> StoreResult<Box<dyn MultipartUpload>> {
        Err(broken())
    }

    fn delete_stream(
        &self,
        _: BoxStream<'static, StoreResult<Path>>,
    ) -> BoxStream<'static, StoreResult<Path>> {
        stream::empty().boxed()
    }

    fn list(&self, prefix: Option<&Path>) -> BoxStream<'static, StoreResult<ObjectMeta>> {
        self.inner.list(prefix)
    }

    async fn list_with_delimiter(&self, prefix: Option<&Path>) -> StoreResult<ListResult> {
        self.inner.list_with_delimiter(prefix).await
    }

    async fn copy_opts(&self, _: &Path, _: &Path, _: CopyOptions) -> StoreResult<()> {
        Err(broken())
    }
}

/// An object of so many bytes, all its blocks different.
struct Case {
    store: Arc<Faulty>,
    content: Vec<u8>,
    pin: Pin,
    stop: Arc<AtomicBool>,
}

impl Case {
    fn new(size: usize, faults: &[Option<Fault>]) -> Self {
        let content: Vec<u8> = (0..size).map(|i| ((i * 7919) >> 5) as u8).collect();
        let inner = InMemory::new();
        let (path, payload) = (Path::from("x"), content.clone().into());
        let put = runtime::spawn(async move {
            inner.put(&path, payload).await.unwrap();
            inner
        });
        let inner = runtime::wait(&put, &AtomicBool::new(false)).unwrap();
        let (faults, asked) = (Mutex::new(faults.to_vec()), Mutex::new(Vec::new()));
        let store = Arc::new(Faulty { inner, faults, asked });
        Self { store, content, pin: Pin::default(), stop: Arc::default() }
    }

    fn open(&self, stretch: Option<(u64, u64)>, purpose: Purpose) -> io::Result<ObjectReader> {
        let (store, path) = (self.store.clone(), Path::from("x"));
        let pause = Duration::from_millis(1);
        let source = Source { store, path, pin: self.pin.clone(), pause };
        ObjectReader::of(source, stretch, purpose, &self.stop)
    }

    /// All bytes, by reads of odd sizes.
    fn read(&self) -> io::Result<Vec<u8>> {
        let mut reader = self.open(None, Purpose::Content)?;
        let (mut all, mut part) = (Vec::new(), vec![0; 1_000_003]);
        loop {
            match reader.read(&mut part)? {
                0 => return Ok(all),
                read => all.extend_from_slice(&part[..read]),
            }
        }
    }

    fn asked(&self) -> Vec<Range<u64>> {
        self.store.asked.lock().unwrap().clone()
    }
}

fn only(range: Range<u64>) -> Vec<Range<u64>> {
    std::iter::once(range).collect()
}

fn reason(error: &io::Error) -> StoreError {
    error.get_ref().unwrap().downcast_ref::<StoreError>().unwrap().clone()
}

#[test]
fn each_block_is_fetched_once_and_in_order() {
    let case = Case::new(9 << 20, &[]);
    assert!(case.read().unwrap() == case.content);
    assert_eq!(case.asked(), [0..BLOCK, BLOCK..2 * BLOCK, 2 * BLOCK..9 << 20]);
}

#[test]
fn bytes_that_break_off_are_fetched_again() {
    use Fault::{Broken, Short};
    let faults = [Some(Broken), Some(Short), None, Some(Broken), Some(Broken), Some(Broken), None];
    let case = Case::new(6 << 20, &faults);
    assert!(case.read().unwrap() == case.content);
    assert_eq!(case.asked().len(), 7);
}

#[test]
fn tries_end() {
    let case = Case::new(1000, &[Some(Fault::Broken); 20]);
    let error = case.read().unwrap_err();
    assert_eq!(reason(&error), StoreError::Failed("connection reset".into()));
    assert_eq!(case.asked().len(), TRIES as usize);
    assert_eq!(case.pin.changed(), None);
}

#[test]
fn an_object_that_changes_between_blocks_is_not_read_on() {
    for (fault, what) in [(Fault::Replaced, "replaced"), (Fault::Removed, "removed")] {
        let case = Case::new(6 << 20, &[None, Some(fault)]);
        assert!(case.read().is_err());
        assert!(case.pin.changed().unwrap().contains(what), "{fault:?}");
        assert_eq!(case.asked().len(), 2, "no second try");
    }
    // Before the first byte it is simply another object, or none.
    let case = Case::new(1000, &[Some(Fault::Replaced)]);
    assert_eq!(case.read().unwrap(), vec![9; 1000]);
    let case = Case::new(1000, &[Some(Fault::Removed)]);
    assert_eq!(reason(&case.read().unwrap_err()), StoreError::Missing);
    assert_eq!(case.pin.changed(), None);
}

#[test]
fn readers_of_one_pin_read_one_version() {
    let case = Case::new(6 << 20, &[None, None, Some(Fault::Replaced)]);
    case.read().unwrap();
    assert!(case.read().is_err(), "the second reader");
    assert!(case.pin.changed().is_some());
}

#[test]
fn stretches_are_objects_of_their_own() {
    let case = Case::new(6 << 20, &[]);
    let mut reader = case.open(Some((BLOCK - 5, 10)), Purpose::Content).unwrap();
    assert_eq!(reader.seek(SeekFrom::End(0)).unwrap(), 10);
    assert_eq!(reader.seek(SeekFrom::Start(2)).unwrap(), 2);
    let mut bytes = Vec::new();
    reader.read_to_end(&mut bytes).unwrap();
    let from = BLOCK as usize - 5;
    assert_eq!(bytes, case.content[from + 2..from + 10]);
    assert_eq!(case.asked(), only(BLOCK - 5..BLOCK + 5), "one request, no byte more");
    // One that the object ends before, and ones without bytes.
    let mut beyond = case.open(Some(((6 << 20) - 3, 10)), Purpose::Content).unwrap();
    assert_eq!(beyond.read_to_end(&mut Vec::new()).unwrap(), 3);
    for stretch in [(9 << 20, 10), (u64::MAX, 10), (5, 0)] {
        let mut none = case.open(Some(stretch), Purpose::Content).unwrap();
        assert_eq!(none.read_to_end(&mut Vec::new()).unwrap(), 0, "{stretch:?}");
    }
}

#[test]
fn an_empty_object_has_no_bytes() {
    let case = Case::new(0, &[]);
    assert!(case.read().unwrap().is_empty());
    assert_eq!(case.pin.version().unwrap().size, 0);
}

#[test]
fn a_look_at_a_header_fetches_little() {
    for purpose in [Purpose::Header, Purpose::Part] {
        let case = Case::new(9 << 20, &[]);
        let mut reader = case.open(None, purpose).unwrap();
        reader.read_exact(&mut vec![0; 10_000]).unwrap();
        assert_eq!(case.asked(), only(0..HEADER), "{purpose:?}");
        // Anywhere, the bytes are those of the file.
        for at in [HEADER - 1, HEADER, HEADER + BLOCK - 1, HEADER + BLOCK, (9 << 20) - 1] {
            let mut byte = [0];
            reader.seek(SeekFrom::Start(at)).unwrap();
            reader.read_exact(&mut byte).unwrap();
            assert_eq!(byte[0], case.content[at as usize], "{at}");
        }
        assert_eq!(reader.read(&mut [0]).unwrap(), 0);
    }
}

#[test]
fn waiting_ends_when_asked_to() {
    let case = Case::new(1000, &[Some(Fault::Silent)]);
    let stop = case.stop.clone();
    let asked = std::thread::spawn(move || {
        std::thread::sleep(Duration::from_millis(20));
        stop.store(true, Ordering::Relaxed);
    });
    assert_eq!(reason(&case.read().unwrap_err()), StoreError::Stopped);
    asked.join().unwrap();
}
