//! Log lines on standard error.

use std::io::IsTerminal;

use tracing_subscriber::EnvFilter;

/// Starts logging; `RUST_LOG` wins over the number of `-v`.
pub fn start(verbose: u8) {
    let levels = match verbose {
        0 => "warn,plicad=info,plica_daemon=info,plica_jobs=info,zenoh=error",
        1 => "info,plicad=debug,plica_daemon=debug,plica_jobs=debug,zenoh=warn",
        _ => "debug,plicad=trace,plica_daemon=trace,plica_jobs=trace",
    };
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new(levels));
    // A second start, as in tests, changes nothing.
    let _ = tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_ansi(std::io::stderr().is_terminal())
        .with_writer(std::io::stderr)
        .with_target(false)
        .try_init();
}
