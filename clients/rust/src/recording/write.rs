//! Writing of recordings.

use std::collections::{BTreeMap, HashMap};
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use mcap::McapError;

use crate::recording::message::{Kind, Recorded, RecordingError};

/// Writes a recording.
pub struct Recorder {
    path: PathBuf,
    writer: mcap::Writer<BufWriter<File>>,
    channels: HashMap<(String, Kind), Channel>,
}

struct Channel {
    id: u16,
    n_messages: u32,
}

impl Recorder {
    /// Starts a file; an existing one is replaced.
    pub fn create(path: impl AsRef<Path>) -> Result<Self, RecordingError> {
        let path = path.as_ref().to_owned();
        let file = File::create(&path).map_err(|error| fault(&path, &error.into()))?;
        // Without seeking, the file holds whole chunks at any moment: nothing is filled in later.
        let options = mcap::WriteOptions::new().compression(None).disable_seeking(true).profile("plica");
        let writer = options.create(BufWriter::new(file)).map_err(|error| fault(&path, &error))?;
        Ok(Self { path, writer, channels: HashMap::new() })
    }

    /// Appends a message. It is in the file after the next [`Recorder::flush`].
    pub fn write(&mut self, message: &Recorded) -> Result<(), RecordingError> {
        self.append(message).map_err(|error| fault(&self.path, &error))
    }

    /// Hands all messages to the operating system: from now on the file holds them, however the process ends.
    pub fn flush(&mut self) -> Result<(), RecordingError> {
        self.writer.flush().map_err(|error| fault(&self.path, &error))
    }

    /// Ends the file with its index. (Dropping does the same, but cannot report an error.)
    pub fn finish(mut self) -> Result<(), RecordingError> {
        self.writer.finish().map(drop).map_err(|error| fault(&self.path, &error))
    }

    fn append(&mut self, message: &Recorded) -> mcap::McapResult<()> {
        let slot = (message.key.clone(), message.kind);
        if !self.channels.contains_key(&slot) {
            let schema = message.kind.schema();
            let schema = self.writer.add_schema(schema.name, schema.encoding, schema.text.as_bytes())?;
            let encoding = message.kind.encoding();
            let id = self.writer.add_channel(schema, &message.key, encoding, &BTreeMap::new())?;
            self.channels.insert(slot.clone(), Channel { id, n_messages: 0 });
        }
        let channel = self.channels.get_mut(&slot).expect("inserted above");
        let header = mcap::records::MessageHeader {
            channel_id: channel.id,
            sequence: channel.n_messages,
            log_time: message.log_time_ns,
            publish_time: message.log_time_ns,
        };
        channel.n_messages = channel.n_messages.wrapping_add(1);
        self.writer.write_to_known_channel(&header, &message.bytes)
    }
}

fn fault(path: &Path, error: &McapError) -> RecordingError {
    let message = match error {
        McapError::Io(error) => format!("cannot be written: {error}"),
        McapError::TooManyChannels => "cannot be written: more than 65,535 keys; record fewer".to_owned(),
        McapError::AttemptedWriteAfterFailure => "cannot be written: an earlier write has failed".to_owned(),
        _ => "cannot be written as MCAP".to_owned(),
    };
    RecordingError { detail: Some(error.to_string()), ..RecordingError::new(path, message) }
}
