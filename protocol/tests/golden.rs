//! The layouts, byte by byte. A change here is a change of the protocol: it needs a new version.
#![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]

use plica_protocol::pose::{self, Pose};
use plica_protocol::skin::{self, SkinFlags, SkinFrame, SkinHeader};
use plica_protocol::wrench::{self, Wrench, WrenchFlags};

/// Hexadecimal digits, blanks ignored.
fn hex(text: &str) -> Vec<u8> {
    let digits: Vec<u8> = text.bytes().filter(u8::is_ascii_hexdigit).collect();
    digits.chunks(2).map(|pair| u8::from_str_radix(std::str::from_utf8(pair).unwrap(), 16).unwrap()).collect()
}

fn a_pose() -> Pose {
    Pose {
        sequence: 0x0102_0304_0506_0708,
        source_time_ns: 0x1112_1314_1516_1718,
        source_id: 0x2122_2324,
        valid: true,
        position_m: [1.0, -2.0, 0.5],
        orientation_xyzw: [0.0, 0.6, 0.0, 0.8],
        buttons: 0x3132_3334,
        grip: 0.25,
    }
}

#[test]
fn pose_has_its_96_bytes() {
    let golden = hex("504c5053 0100 6000 0807060504030201 1817161514131211 24232221 01000000
         000000000000f03f 00000000000000c0 000000000000e03f
         0000000000000000 333333333333e33f 0000000000000000 9a9999999999e93f
         34333231 0000803e");
    assert_eq!(golden.len(), pose::BYTES);
    assert_eq!(a_pose().encode().as_slice(), golden);
    assert_eq!(Pose::decode(&golden).unwrap(), a_pose());
}

#[test]
fn pose_has_its_json() {
    let golden = r#"{"sequence":72623859790382856,"source_time_ns":1230066625199609624,"source_id":555885348,"valid":true,"position":[1.0,-2.0,0.5],"orientation":[0.0,0.6,0.0,0.8],"buttons":825373492,"grip":0.25}"#;
    assert_eq!(a_pose().to_json(), golden);
    assert_eq!(Pose::decode_json(golden.as_bytes()).unwrap(), a_pose());
}

#[test]
fn json_pose_needs_position_and_orientation_only() {
    let shortest = br#"{"position": [0, 0, 0.1], "orientation": [0, 0, 0, 1]}"#;
    let expected = Pose { position_m: [0.0, 0.0, 0.1], ..Pose::default() };
    assert_eq!(Pose::decode_json(shortest).unwrap(), expected);
}

#[test]
fn wrench_has_its_192_bytes() {
    let wrench = Wrench {
        sequence: 1,
        tick: 2,
        sim_time_s: 0.5,
        pose_sequence: 3,
        pose_source_time_ns: 4,
        force_n: [1.0, 2.0, 3.0],
        torque_n_m: [4.0, 5.0, 6.0],
        contact_point_m: [7.0, 8.0, 9.0],
        proxy_position_m: [10.0, 11.0, 12.0],
        proxy_orientation_xyzw: [0.0, 0.0, 0.0, 1.0],
        flags: WrenchFlags { in_contact: true, sliding: false, saturated: true, stale: true },
        n_contacts: 5,
        confidence: 0.75,
    };
    let golden = hex("504c5752 0100 c000 0100000000000000 0200000000000000 000000000000e03f
         0300000000000000 0400000000000000
         000000000000f03f 0000000000000040 0000000000000840
         0000000000001040 0000000000001440 0000000000001840
         0000000000001c40 0000000000002040 0000000000002240
         0000000000002440 0000000000002640 0000000000002840
         0000000000000000 0000000000000000 0000000000000000 000000000000f03f
         0d000000 05000000 0000403f 00000000");
    assert_eq!(golden.len(), wrench::BYTES);
    assert_eq!(wrench.encode().as_slice(), golden);
    assert_eq!(Wrench::decode(&golden).unwrap(), wrench);
}

fn a_header() -> SkinHeader {
    SkinHeader {
        sequence: 1,
        tick: 2,
        sim_time_s: 0.5,
        newest_pose_source_time_ns: 3,
        flags: SkinFlags { enriched: true, sleeping: true, ..SkinFlags::default() },
        confidence: 0.75,
        database_generation: 4,
        ..SkinHeader::default()
    }
}

#[test]
fn skin_in_f32_has_its_bytes() {
    let mut bytes = vec![0xff; 7];
    let normals = [[0.0, 0.0, 1.0]];
    skin::encode_f32_into(&mut bytes, &a_header(), &[[1.0, 2.0, -0.5]], Some(&normals)).unwrap();
    let golden = hex("504c534b 0100 4000 0100000000000000 0200000000000000 000000000000e03f
         0300000000000000 01000000 0d000000 0000403f 04000000 00000000 00000000
         0000803f 00000040 000000bf  00000000 00000000 0000803f");
    assert_eq!(bytes, golden);
    let frame = SkinFrame::decode(&bytes).unwrap();
    assert_eq!(frame.vectors(), [[1.0, 2.0, -0.5]]);
    assert_eq!(frame.normals().unwrap(), normals);
    assert_eq!(frame.header.frame_bytes(), golden.len() as u64);
}

#[test]
fn skin_in_16_bit_has_its_bytes() {
    let rest = [[0.0; 3], [1.0; 3]];
    let one = 32767.0 / 65536.0; // scale = 2^-16 exactly
    let positions = [[one, -one, 0.0], [1.0, 1.0 + 1.0 / 65536.0, 1.0]];
    let normals = [[0.0, 0.0, 1.0], [0.0, -1.0, 0.0]];
    let mut bytes = Vec::new();
    skin::encode_i16_into(&mut bytes, &a_header(), &positions, &rest, Some(&normals)).unwrap();
    let golden = hex("504c534b 0100 4000 0100000000000000 0200000000000000 000000000000e03f
         0300000000000000 02000000 1d000000 0000403f 04000000 00008037 00000000
         ff7f 0180 0000  0000 0100 0000   0000 0000 ff7f  0000 0180 0000");
    assert_eq!(bytes, golden);
    let frame = SkinFrame::decode(&bytes).unwrap();
    assert_eq!(frame.positions_m(&rest).unwrap(), positions);
    assert_eq!(frame.positions_m(&rest[..1]), None);
    assert_eq!(frame.normals().unwrap(), normals);
}

#[test]
fn a_skin_at_rest_has_scale_zero_in_16_bit() {
    let rest = [[0.1, 0.2, 0.3]];
    let mut bytes = Vec::new();
    skin::encode_i16_into(&mut bytes, &a_header(), &rest, &rest, None).unwrap();
    let frame = SkinFrame::decode(&bytes).unwrap();
    assert_eq!(frame.header.scale, 0.0);
    assert_eq!(frame.positions_m(&rest).unwrap(), rest);
}

#[test]
fn arrays_of_different_length_are_refused() {
    let (two, one) = ([[0.0; 3]; 2], [[0.0; 3]; 1]);
    let mut out = Vec::new();
    let error = skin::encode_f32_into(&mut out, &a_header(), &two, Some(&one)).unwrap_err();
    assert_eq!(error.to_string(), "normals has 1 vertices, positions have 2");
    skin::encode_i16_into(&mut out, &a_header(), &two, &one, None).unwrap_err();
}
