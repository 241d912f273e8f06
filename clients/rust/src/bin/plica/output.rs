//! What a person and what a program reads.

use std::io::Write;
use std::process::ExitCode;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};
use plica_client::ClientError;
use plica_client::mesh::MeshError;
use plica_client::recording::RecordingError;
use serde_json::{Value, json};

/// Text for people, or one JSON object as the last line of standard output; never both on standard output.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Output {
    pub(crate) json: bool,
    /// Whether errors show the text of the library beneath.
    pub(crate) verbose: bool,
}

impl Output {
    /// The end of a command.
    pub(crate) fn result(self, value: &Value, text: &str) {
        let mut out = std::io::stdout();
        // A reader that has seen enough, like `head`, is no fault.
        let _ = if self.json { writeln!(out, "{value}") } else { writeln!(out, "{text}") };
    }

    /// The end of a command that failed; with the code, if the daemon refused.
    pub(crate) fn error(self, error: &anyhow::Error) {
        eprintln!("plica: {error:#}");
        if let Some(detail) = detail(error).filter(|_| self.verbose) {
            eprintln!("plica: {detail}");
        }
        if !self.json {
            return;
        }
        let mut object = json!({"message": format!("{error:#}")});
        if let Some(ClientError::Refused(reply)) = error.downcast_ref() {
            object["code"] = reply.code.as_str().into();
            // All keys of the reply; the message is the one printed.
            let reply = serde_json::to_value(reply).unwrap_or_default();
            object = json!({"message": object["message"]});
            for (key, value) in reply.as_object().into_iter().flatten().filter(|(key, _)| *key != "message") {
                object[key] = value.clone();
            }
        }
        println!("{}", json!({"error": object}));
    }

    /// Help, the version, or what is wrong with the arguments.
    pub(crate) fn say(answer: &clap::Error) -> ExitCode {
        // Without standard output or error there is nothing left to say.
        let _ = answer.print();
        if answer.use_stderr() && std::env::args_os().any(|argument| argument == "--json") {
            println!("{}", json!({"error": {"message": answer.to_string().trim()}}));
        }
        ExitCode::from(u8::try_from(answer.exit_code()).unwrap_or(1))
    }

    /// A note that is not the result.
    pub(crate) fn note(self, text: &str) {
        eprintln!("plica: {text}");
    }
}

/// Text of the library beneath an error.
fn detail(error: &anyhow::Error) -> Option<&str> {
    error.chain().find_map(|cause| {
        let client = cause.downcast_ref::<ClientError>().and_then(ClientError::detail);
        let recording = || cause.downcast_ref::<RecordingError>().and_then(|error| error.detail.as_deref());
        let mesh = || match cause.downcast_ref()? {
            MeshError::Gltf(text) => Some(text.as_str()),
            MeshError::Empty => None,
        };
        client.or_else(recording).or_else(mesh)
    })
}

/// A bar on standard error, shown on a terminal only; without a length it spins.
pub(crate) fn progress(length: Option<u64>, unit: &str) -> ProgressBar {
    let bar = length.map_or_else(ProgressBar::new_spinner, ProgressBar::new);
    let template = match length {
        Some(_) => format!("{{bar:40}} {{pos}}/{{len}} {unit} {{msg}}"),
        None => format!("{{spinner}} {{pos}} {unit} {{msg}}"),
    };
    if let Ok(style) = ProgressStyle::with_template(&template) {
        bar.set_style(style);
    }
    bar.enable_steady_tick(Duration::from_millis(200));
    bar
}
