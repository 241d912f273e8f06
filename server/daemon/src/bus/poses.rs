//! Subscribes to poses.

use std::sync::Arc;

use plica_protocol::ENCODING_BYTES;
use plica_protocol::encoding::is_json;
use plica_protocol::pose::Pose;
use zenoh::Wait;
use zenoh::bytes::Encoding;
use zenoh::pubsub::Subscriber;
use zenoh::sample::{Sample, SampleKind};

use super::error::BusError;
use super::guard::guarded;
use super::shared::Shared;

pub(super) fn declare(shared: &Arc<Shared>) -> Result<Subscriber<()>, BusError> {
    let binary = Encoding::from(ENCODING_BYTES);
    let receiver = Arc::clone(shared);
    let callback = guarded(&shared.counters, move |sample: Sample| receive(&receiver, &binary, &sample));
    let subscriber = shared.session.declare_subscriber(shared.keys.pose("*")).callback(callback);
    subscriber.wait().map_err(|e| shared.error(e))
}

fn receive(shared: &Shared, binary: &Encoding, sample: &Sample) {
    if sample.kind() != SampleKind::Put {
        return;
    }
    let tool = shared.keys.tool_of_pose(sample.key_expr().as_str()).and_then(|name| shared.intake.tool(name));
    let Some(tool) = tool else {
        shared.counters.count("unknown_tool");
        return;
    };
    let bytes = sample.payload().to_bytes();
    // Most poses are binary, and need no string.
    let is_json = sample.encoding() != binary && is_json(&sample.encoding().to_string());
    let scale = shared.scene.tools[tool].position_scale;
    let decode = if is_json { Pose::decode_json_for } else { Pose::decode_for };
    shared.intake.arrive(tool, decode(&bytes, scale));
}
