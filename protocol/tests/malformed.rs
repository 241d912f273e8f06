//! Nothing that arrives may panic, and each fault has its own counter.
#![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]

use plica_protocol::DecodeError;
use plica_protocol::chunk::ChunkHeader;
use plica_protocol::pose::Pose;
use plica_protocol::rpc::{EmptyRequest, RestoreRequest, StepRequest, decode_request};
use plica_protocol::skin::{self, SkinFrame, SkinHeader};
use plica_protocol::wrench::Wrench;
use proptest::prelude::*;

fn kind<T: std::fmt::Debug>(result: Result<T, DecodeError>) -> &'static str {
    let kind = result.unwrap_err().kind();
    assert!(DecodeError::KINDS.contains(&kind));
    kind
}

fn a_skin() -> Vec<u8> {
    let mut bytes = Vec::new();
    let header = SkinHeader::default();
    skin::encode_f32_into(&mut bytes, &header, &[[1.0, 2.0, 3.0]; 3], Some(&[[0.0, 0.0, 1.0]; 3])).unwrap();
    bytes
}

fn pose_kind(pose: Pose) -> &'static str {
    kind(Pose::decode(&pose.encode()))
}

#[test]
fn truncated_at_every_length() {
    let (pose, wrench, skin) = (Pose::default().encode(), Wrench::default().encode(), a_skin());
    (0..pose.len()).for_each(|n| assert_eq!(kind(Pose::decode(&pose[..n])), "too_short", "{n} bytes"));
    (0..wrench.len()).for_each(|n| assert_eq!(kind(Wrench::decode(&wrench[..n])), "too_short", "{n} bytes"));
    (0..skin.len()).for_each(|n| assert_eq!(kind(SkinFrame::decode(&skin[..n])), "too_short", "{n} bytes"));
}

#[test]
fn one_byte_too_many() {
    let longer = |bytes: &[u8]| [bytes, &[0]].concat();
    assert_eq!(kind(Pose::decode(&longer(&Pose::default().encode()))), "bad_length");
    assert_eq!(kind(Wrench::decode(&longer(&Wrench::default().encode()))), "bad_length");
    assert_eq!(kind(SkinFrame::decode(&longer(&a_skin()))), "bad_length");
}

type Decode = fn(&[u8]) -> &'static str;

#[test]
fn every_bit_of_the_first_eight_bytes_counts() {
    let messages: [(Vec<u8>, Decode); 3] = [
        (Pose::default().encode().to_vec(), |bytes| kind(Pose::decode(bytes))),
        (Wrench::default().encode().to_vec(), |bytes| kind(Wrench::decode(bytes))),
        (a_skin(), |bytes| kind(SkinFrame::decode(bytes))),
    ];
    for (message, decode) in messages {
        for bit in 0..64 {
            let mut flipped = message.clone();
            flipped[bit / 8] ^= 1 << (bit % 8);
            let expected = ["bad_magic", "bad_magic", "bad_version", "bad_length"][bit / 16];
            assert_eq!(decode(&flipped), expected, "bit {bit}");
        }
    }
}

#[test]
fn the_gate_of_poses() {
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        assert_eq!(pose_kind(Pose { position_m: [0.0, bad, 0.0], ..Pose::default() }), "non_finite");
        assert_eq!(pose_kind(Pose { orientation_xyzw: [0.0, 0.0, bad, 1.0], ..Pose::default() }), "non_finite");
        assert_eq!(pose_kind(Pose { grip: bad as f32, ..Pose::default() }), "non_finite");
    }
    let at = |x: f64| Pose { position_m: [x, 0.0, 0.0], ..Pose::default() };
    assert_eq!(pose_kind(at(1000.1)), "out_of_range");
    assert_eq!(pose_kind(at(-1e300)), "out_of_range");
    assert_eq!(Pose::decode(&at(-1000.0).encode()).unwrap(), at(-1000.0));
    // A tracker that measures in millimetres.
    assert_eq!(Pose::decode_for(&at(-1e6).encode(), 1e-3).unwrap(), at(-1e6));
    assert_eq!(kind(Pose::decode_for(&at(1.1e6).encode(), 1e-3)), "out_of_range");
    assert_eq!(kind(Pose::decode_json_for(at(1.1).to_json().as_bytes(), 1e3)), "out_of_range");
    let turned = |w: f64| Pose { orientation_xyzw: [0.0, 0.0, 0.0, w], ..Pose::default() };
    assert_eq!(pose_kind(turned(0.0)), "not_unit");
    assert_eq!(pose_kind(turned(0.989)), "not_unit");
    assert_eq!(pose_kind(turned(1.011)), "not_unit");
    assert_eq!(Pose::decode(&turned(0.995).encode()).unwrap(), turned(1.0));
}

#[test]
fn an_unknown_flag_is_ignored() {
    let mut bytes = Pose::default().encode();
    bytes[31] = 0x80;
    assert_eq!(Pose::decode(&bytes).unwrap(), Pose::default());
}

#[test]
fn wrenches_and_headers_must_be_finite() {
    let mut bytes = Wrench::default().encode();
    bytes[48..56].copy_from_slice(&f64::NAN.to_le_bytes());
    assert_eq!(kind(Wrench::decode(&bytes)), "non_finite");
    let mut bytes = a_skin();
    bytes[56..60].copy_from_slice(&f32::INFINITY.to_le_bytes());
    assert_eq!(kind(SkinFrame::decode(&bytes)), "non_finite");
}

#[test]
fn a_skin_that_claims_four_thousand_million_vertices() {
    let mut bytes = a_skin();
    bytes[40..44].copy_from_slice(&u32::MAX.to_le_bytes());
    assert_eq!(kind(SkinFrame::decode(&bytes)), "too_short");
}

#[test]
fn json_poses_of_another_shape() {
    let bad: [&[u8]; 10] = [
        b"",
        b"null",
        b"{",
        b"\xff\xfe",
        br#"{"position": [0, 0, 0]}"#,
        br#"{"position": [0, 0], "orientation": [0, 0, 0, 1]}"#,
        br#"{"position": [0, 0, NaN], "orientation": [0, 0, 0, 1]}"#,
        br#"{"position": [0, 0, 1e999], "orientation": [0, 0, 0, 1]}"#,
        br#"{"position": [0, 0, 0], "orientation": [0, 0, 0, 1], "sequence": -1}"#,
        br#"{"position": [0, 0, 0], "orientation": [0, 0, 0, 1], "orientaton": 1}"#,
    ];
    for json in bad {
        assert_eq!(kind(Pose::decode_json(json)), "bad_json", "{}", String::from_utf8_lossy(json));
    }
    let far = br#"{"position": [0, 0, 1e4], "orientation": [0, 0, 0, 1]}"#;
    assert_eq!(kind(Pose::decode_json(far)), "out_of_range");
    let long = br#"{"position": [0, 0, 0], "orientation": [0, 0, 0, 2]}"#;
    assert_eq!(kind(Pose::decode_json(long)), "not_unit");
    let huge_grip = br#"{"position": [0, 0, 0], "orientation": [0, 0, 0, 1], "grip": 1e300}"#;
    assert_eq!(kind(Pose::decode_json(huge_grip)), "bad_json");
}

#[test]
fn deeply_nested_json_is_an_error() {
    let nested = "[".repeat(100_000);
    assert_eq!(kind(Pose::decode_json(nested.as_bytes())), "bad_json");
}

proptest! {
    #[test]
    fn random_bytes_never_panic(bytes in proptest::collection::vec(any::<u8>(), 0..400)) {
        decode_everything(&bytes);
    }

    #[test]
    fn random_bodies_behind_a_good_start_never_panic(
        message in 0..3_usize,
        body in proptest::collection::vec(any::<u8>(), 0..300),
    ) {
        let start: [&[u8]; 3] = [b"PLPS\x01\0\x60\0", b"PLWR\x01\0\xc0\0", b"PLSK\x01\0\x40\0"];
        decode_everything(&[start[message], &body].concat());
        let exact = [88, 184, 56][message];
        let filled: Vec<u8> = body.iter().copied().chain(std::iter::repeat(0)).take(exact).collect();
        decode_everything(&[start[message], &filled].concat());
    }

    #[test]
    fn any_pose_comes_back(
        sequence: u64, source_time_ns: u64, source_id: u32, valid: bool, buttons: u32, grip in -1e3_f32..1e3,
        position_m in proptest::array::uniform3(-500.0..500.0_f64),
        q in proptest::array::uniform4(-1.0..1.0_f64),
    ) {
        let norm = q.iter().map(|c| c * c).sum::<f64>().sqrt();
        prop_assume!(norm > 1e-3);
        let orientation_xyzw = q.map(|c| 1.005 * c / norm);
        let sent = Pose { sequence, source_time_ns, source_id, valid, position_m, orientation_xyzw, buttons, grip };
        let once = Pose::decode(&sent.encode()).unwrap();
        prop_assert_eq!(once.position_m, position_m);
        // The gate applied again, in either form, changes no bit.
        prop_assert_eq!(Pose::decode(&once.encode()).unwrap().encode(), once.encode());
        prop_assert_eq!(Pose::decode_json(once.to_json().as_bytes()).unwrap().encode(), once.encode());
    }

    #[test]
    fn any_frame_comes_back(vectors in proptest::collection::vec(proptest::array::uniform3(-1.0..1.0_f32), 0..50)) {
        let mut bytes = Vec::new();
        skin::encode_f32_into(&mut bytes, &SkinHeader::default(), &vectors, None).unwrap();
        prop_assert_eq!(&SkinFrame::decode(&bytes).unwrap().vectors(), &vectors);
        let rest = vec![[0.5; 3]; vectors.len()];
        skin::encode_i16_into(&mut bytes, &SkinHeader::default(), &vectors, &rest, None).unwrap();
        let frame = SkinFrame::decode(&bytes).unwrap();
        for (back, sent) in frame.positions_m(&rest).unwrap().iter().zip(&vectors) {
            for axis in 0..3 {
                prop_assert!((back[axis] - sent[axis]).abs() <= 0.51 * frame.header.scale + 1e-6);
            }
        }
    }
}

fn decode_everything(bytes: &[u8]) {
    let _ = Pose::decode(bytes);
    let _ = Pose::decode_json(bytes);
    let _ = Wrench::decode(bytes);
    let _ = ChunkHeader::from_json(bytes);
    let _ = decode_request::<EmptyRequest>(bytes);
    let _ = decode_request::<StepRequest>(bytes);
    let _ = decode_request::<RestoreRequest>(bytes);
    if let Ok(frame) = SkinFrame::decode(bytes) {
        frame.vectors();
        frame.normals();
    }
}
