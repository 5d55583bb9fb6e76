use super::header::MAGIC;
use super::*;
use proptest::prelude::*;

/// A header as numpy would write it for the given text and version.
fn file(version: u8, text: &str) -> Vec<u8> {
    let mut bytes = MAGIC.to_vec();
    bytes.extend([version, 0]);
    match version {
        1 => bytes.extend((text.len() as u16).to_le_bytes()),
        _ => bytes.extend((text.len() as u32).to_le_bytes()),
    }
    bytes.extend(text.as_bytes());
    bytes
}

#[test]
fn encodes_what_numpy_save_writes() {
    let header = Header::new(DType::F32, &[2, 3, 4]).fortran();
    let bytes = header.encode();
    assert_eq!(bytes.len(), 128);
    let text = "{'descr': '<f4', 'fortran_order': True, 'shape': (2, 3, 4), }";
    let mut expected = b"\x93NUMPY\x01\x00\x76\x00".to_vec();
    expected.extend(text.as_bytes());
    expected.resize(127, b' ');
    expected.push(b'\n');
    assert_eq!(bytes, expected);
}

#[test]
fn reads_all_versions_quotes_orders_and_byte_orders() {
    for version in 1..=3 {
        let text = "{\"shape\":(5L,), 'fortran_order': False,'descr': '>i8'}   \n";
        let (header, length) = Header::read(&mut file(version, text).as_slice()).unwrap();
        assert_eq!(header.shape, [5]);
        assert_eq!(header.dtype, DType { kind: Kind::Int, itemsize: 8, big_endian: true });
        assert_eq!(length as usize, text.len() + if version == 1 { 10 } else { 12 });
    }
}

#[test]
fn refusals_name_the_byte() {
    let cases = [
        ("{'descr': 'O', 'fortran_order': False, 'shape': ()}", "element type"),
        ("{'descr': '<f4', 'fortran_order': 1, 'shape': ()}", "byte 44: expected True"),
        ("{'descr': '<f4', 'fortran_order': False, 'shape': (-1,)}", "axis lengths"),
        ("{'descr': '<f4', 'fortran_order': False}", "the keys descr"),
        ("{'descr': '<f4', 'descr': '<f4'}", "once, found descr"),
        ("{'descr': '<f4', 'fortran_order': False, 'shape': ()} x", "padding"),
        (
            "{'descr': '<f8', 'fortran_order': False, 'shape': (4294967296, 4294967296)}",
            "too large",
        ),
    ];
    for (text, message) in cases {
        let error = Header::read(&mut file(1, text).as_slice()).unwrap_err().to_string();
        assert!(error.contains(message), "{text}: {error}");
    }
    let huge = [&b"\x93NUMPY\x02\x00"[..], &[0xff; 4]].concat();
    assert!(Header::read(&mut huge.as_slice()).unwrap_err().to_string().contains("at most"));
}

proptest! {
    #[test]
    fn headers_survive_a_round_trip(
        shape in prop::collection::vec(0u64..10, 0..6),
        descr in prop::sample::select(vec![
            "|b1", "|i1", "<i2", ">i4", "<i8", "|u1", "<u2", "<u4", ">u8", "<f4", ">f8", "<c8",
            "<c16", "<U7", ">U0", "|S5",
        ]),
        order in prop::sample::select(vec![Order::C, Order::Fortran]),
    ) {
        let dtype = DType::parse(descr).unwrap();
        prop_assert_eq!(dtype.to_string(), descr);
        let header = Header { dtype, order, shape };
        let bytes = header.encode();
        prop_assert_eq!(bytes.len() % 64, 0);
        let (read, length) = Header::read(&mut bytes.as_slice()).unwrap();
        prop_assert_eq!(read, header);
        prop_assert_eq!(length, bytes.len() as u64);
    }

    #[test]
    fn any_bytes_give_an_answer(tail in prop::collection::vec(any::<u8>(), 0..200)) {
        let text = String::from_utf8_lossy(&tail).into_owned();
        let _ = Header::read(&mut file(1, &text).as_slice());
        let _ = Header::read(&mut tail.as_slice());
    }

    #[test]
    fn any_edit_of_a_header_gives_an_answer(at in 0usize..128, byte in any::<u8>()) {
        let mut bytes = Header::new(DType::F32, &[2, 3, 4]).encode();
        bytes[at] = byte;
        let _ = Header::read(&mut bytes.as_slice());
    }
}
