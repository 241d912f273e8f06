//! Bytes and operations of a tick.

use plica_sim::Model;

/// Solver iterations and passes assumed where there is no motion to try.
pub const TYPICAL: (f64, f64) = (4.0, 2.0);
/// How far a tick usually stays from its limit.
pub const TYPICAL_RATIO: f64 = 3.0;

/// Bytes of the tables that a tick reads.
pub fn table_bytes(model: &Model) -> usize {
    let cost = model.cost();
    cost.product_bytes + cost.preconditioner_bytes + cost.embedding_bytes
}

/// Bytes and operations of a tick: every iteration multiplies by the stiffness and applies the preconditioner once, every
/// pass evaluates one residual more; the skin is embedded once. Enrichment and contact rows are left out.
pub fn work(model: &Model, iterations: f64, passes: f64) -> (f64, f64) {
    let cost = model.cost();
    let products = iterations + passes;
    let bytes = products * cost.product_bytes as f64
        + iterations * cost.preconditioner_bytes as f64
        + cost.embedding_bytes as f64;
    // Preconditioner and embedding do one multiply-add per 4-byte weight and component; weights are read once.
    let flops = products * cost.product_flops as f64
        + 0.5 * iterations * cost.preconditioner_bytes as f64
        + 1.5 * cost.embedding_bytes as f64;
    (bytes, flops)
}
