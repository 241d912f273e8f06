//! Reading of recordings: in order of log time, as far as the file goes.

use std::collections::{BTreeMap, HashMap};
use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use mcap::records::{Record, op};

use crate::recording::decompress::decompress;
use crate::recording::message::{Kind, Recorded, RecordingError};

/// Operation code and length before each record.
const RECORD_HEAD_BYTES: u64 = 9;
/// Topics of other programs named in a note.
const TOPICS_NAMED: usize = 3;

/// Contents of a recording.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Recording {
    /// Messages of the wanted kinds, in order of log time; those of one time in the order of the file.
    pub messages: Vec<Recorded>,
    /// Number of messages of all kinds, wanted or not.
    pub n_messages: u64,
    /// Whether the file has its end. One of a recorder that was killed, or one cut short, has none.
    pub has_end: bool,
    /// Parts of the file left out because a checksum, a compression or a record is damaged.
    pub n_damaged: u64,
    /// Number of messages of other programs, by topic.
    pub foreign: BTreeMap<String, u64>,
    first_ns: u64,
    last_ns: u64,
    path: PathBuf,
}

impl Recording {
    /// Time from the first message to the last, in seconds.
    pub fn seconds(&self) -> f64 {
        self.last_ns.saturating_sub(self.first_ns) as f64 * 1e-9
    }

    /// Sentences about what is missing or was left out.
    pub fn notes(&self) -> Vec<String> {
        let file = self.path.display();
        let mut notes = Vec::new();
        if !self.has_end {
            notes.push(format!(
                "{file}: the file has no end, as after a killed recorder or an incomplete copy; {} messages over {:.1} s were recovered",
                self.n_messages,
                self.seconds()
            ));
        }
        if self.n_damaged > 0 {
            notes.push(format!("{file}: {} damaged part(s) of the file were left out", self.n_damaged));
        }
        if !self.foreign.is_empty() {
            notes.push(format!("{file}: {} were left out", self.foreign_messages()));
        }
        notes
    }

    /// Number and topics of the messages of other programs.
    pub fn foreign_messages(&self) -> String {
        let n_messages: u64 = self.foreign.values().sum();
        let mut topics: Vec<&str> = self.foreign.keys().take(TOPICS_NAMED).map(String::as_str).collect();
        topics.extend((self.foreign.len() > TOPICS_NAMED).then_some("..."));
        format!("{n_messages} messages on {} channel(s) of other programs ({})", self.foreign.len(), topics.join(", "))
    }
}

/// Reads the messages of some kinds from a recording, uncompressed or with chunks of zstd or lz4.
///
/// # Errors
/// [`RecordingError`] if the file cannot be read, is empty, is not MCAP, or has chunks of another compression. A file
/// without an end is none: see [`Recording::has_end`].
pub fn read(path: impl AsRef<Path>, wanted: &[Kind]) -> Result<Recording, RecordingError> {
    let path = path.as_ref();
    let mut reader = Reader {
        channels: HashMap::new(),
        wanted,
        recording: Recording {
            messages: Vec::new(),
            n_messages: 0,
            has_end: false,
            n_damaged: 0,
            foreign: BTreeMap::new(),
            first_ns: u64::MAX,
            last_ns: 0,
            path: path.to_owned(),
        },
    };
    reader.file(path).map_err(|fault| match fault {
        Fault::Io(error) => RecordingError::new(path, format!("cannot be read: {error}")),
        Fault::Sentence(message) => RecordingError::new(path, message),
    })?;
    reader.recording.messages.sort_by_key(|message| message.log_time_ns);
    Ok(reader.recording)
}

enum Fault {
    Io(io::Error),
    Sentence(String),
}

impl From<io::Error> for Fault {
    fn from(error: io::Error) -> Self {
        Self::Io(error)
    }
}

struct Channel {
    topic: String,
    /// `None`: of another program.
    kind: Option<Kind>,
}

struct Reader<'a> {
    channels: HashMap<u16, Channel>,
    wanted: &'a [Kind],
    recording: Recording,
}

impl Reader<'_> {
    fn file(&mut self, path: &Path) -> Result<(), Fault> {
        let file = File::open(path)?;
        let metadata = file.metadata()?;
        if !metadata.is_file() {
            return Err(Fault::Sentence("not a regular file".to_owned()));
        }
        let mut left = metadata.len();
        let mut file = BufReader::new(file);
        check_start(&mut file, left)?;
        left -= mcap::MAGIC.len() as u64;
        while left >= RECORD_HEAD_BYTES {
            let mut head = [0; RECORD_HEAD_BYTES as usize];
            file.read_exact(&mut head)?;
            left -= RECORD_HEAD_BYTES;
            let [code, length @ ..] = head;
            let length = u64::from_le_bytes(length);
            let is_whole = length <= left;
            match code {
                op::DATA_END if is_whole => {
                    self.recording.has_end = has_end(&mut file)?;
                    return Ok(());
                }
                op::CHUNK => self.chunk(&bytes(&mut file, length.min(left))?, is_whole)?,
                _ if !is_whole => return Ok(()),
                op::CHANNEL | op::MESSAGE => {
                    let body = bytes(&mut file, length)?;
                    self.record(mcap::parse_record(code, &body).ok());
                }
                // A file that was never written here, as after a power failure.
                0 => return Ok(()),
                _ => file.seek_relative(length as i64)?,
            }
            left -= length.min(left);
        }
        Ok(())
    }

    /// Records of a chunk; of one that is not whole, those before the cut.
    fn chunk(&mut self, body: &[u8], is_whole: bool) -> Result<(), Fault> {
        let Some(chunk) = Chunk::parse(body) else {
            self.recording.n_damaged += u64::from(is_whole);
            return Ok(());
        };
        let Some(content) = decompress(&chunk.compression, chunk.data, chunk.uncompressed_bytes) else {
            return Err(Fault::Sentence(format!(
                "its chunks are compressed with `{}`; zstd, lz4 and none can be read: convert it with `mcap compress`",
                chunk.compression
            )));
        };
        let has_all = content.is_whole && content.bytes.len() as u64 == chunk.uncompressed_bytes;
        let is_intact = has_all && (chunk.crc == 0 || crc32fast::hash(&content.bytes) == chunk.crc);
        if is_whole && !is_intact {
            self.recording.n_damaged += 1;
            return Ok(());
        }
        let mut left = content.bytes.as_slice();
        while let Some((head, rest)) = left.split_first_chunk::<{ RECORD_HEAD_BYTES as usize }>() {
            let [code, length @ ..] = *head;
            let length = usize::try_from(u64::from_le_bytes(length)).unwrap_or(usize::MAX);
            let Some((body, rest)) = rest.split_at_checked(length) else { break };
            self.record(mcap::parse_record(code, body).ok());
            left = rest;
        }
        Ok(())
    }

    fn record(&mut self, record: Option<Record<'_>>) {
        match record {
            Some(Record::Channel(channel)) => {
                let kind = Kind::of_channel(&channel.topic, &channel.message_encoding);
                self.channels.insert(channel.id, Channel { topic: channel.topic, kind });
            }
            Some(Record::Message { header, data }) => self.message(header.channel_id, header.log_time, &data),
            Some(_) => {}
            None => self.recording.n_damaged += 1,
        }
    }

    fn message(&mut self, channel_id: u16, log_time_ns: u64, data: &[u8]) {
        let recording = &mut self.recording;
        let Some(channel) = self.channels.get(&channel_id) else {
            recording.n_damaged += 1;
            return;
        };
        let Some(kind) = channel.kind else {
            *recording.foreign.entry(channel.topic.clone()).or_default() += 1;
            return;
        };
        recording.n_messages += 1;
        recording.first_ns = recording.first_ns.min(log_time_ns);
        recording.last_ns = recording.last_ns.max(log_time_ns);
        if self.wanted.contains(&kind) {
            recording.messages.push(Recorded { key: channel.topic.clone(), kind, log_time_ns, bytes: data.to_vec() });
        }
    }
}

fn check_start(file: &mut impl Read, length: u64) -> Result<(), Fault> {
    let fault = |text: &str| Err(Fault::Sentence(text.to_owned()));
    if length == 0 {
        return fault("the file is empty; the recorder ended before it wrote anything");
    }
    let start = bytes(file, mcap::MAGIC.len() as u64)?;
    if start == mcap::MAGIC {
        return Ok(());
    }
    if mcap::MAGIC.starts_with(&start) {
        return fault("the file ends within its first eight bytes; nothing can be recovered");
    }
    fault(
        "not an MCAP file; expected a recording made by `plica record` (`plica probe --poses FILE` plays CSV and TUM files)",
    )
}

/// Whether the file ends as MCAP files do, behind its summary.
fn has_end(file: &mut BufReader<File>) -> io::Result<bool> {
    file.seek(SeekFrom::End(-(mcap::MAGIC.len() as i64)))?;
    Ok(bytes(file, mcap::MAGIC.len() as u64)? == mcap::MAGIC)
}

/// The next `length` bytes, or fewer where the file ends. Memory grows with the bytes that are there, not with a length
/// that a damaged file names.
fn bytes(file: &mut impl Read, length: u64) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    file.take(length).read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// A chunk record: two times (u64), uncompressed bytes (u64), checksum (u32), compression (string), compressed bytes (u64),
/// data.
struct Chunk<'a> {
    uncompressed_bytes: u64,
    crc: u32,
    compression: String,
    data: &'a [u8],
}

impl<'a> Chunk<'a> {
    fn parse(body: &'a [u8]) -> Option<Self> {
        let (_times, rest) = body.split_at_checked(16)?;
        let (uncompressed_bytes, rest) = rest.split_first_chunk()?;
        let (crc, rest) = rest.split_first_chunk()?;
        let (name_bytes, rest) = rest.split_first_chunk()?;
        let (compression, rest) = rest.split_at_checked(u32::from_le_bytes(*name_bytes) as usize)?;
        let (compressed_bytes, data) = rest.split_first_chunk()?;
        let compressed_bytes = usize::try_from(u64::from_le_bytes(*compressed_bytes)).unwrap_or(usize::MAX);
        Some(Self {
            uncompressed_bytes: u64::from_le_bytes(*uncompressed_bytes),
            crc: u32::from_le_bytes(*crc),
            compression: String::from_utf8(compression.to_vec()).ok()?,
            data: &data[..compressed_bytes.min(data.len())],
        })
    }
}
