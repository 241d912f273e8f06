//! Names, rates and formats of the served scene.

use plica_scene::scene::PublishConfig;

/// Names, rates and formats of the served scene.
#[derive(Debug, Clone)]
pub struct SceneInfo {
    /// Name of the scene.
    pub name: String,
    /// Name of the object.
    pub object: String,
    /// Names of the tools, in the model's order.
    pub tools: Vec<String>,
    /// Age at which each tool is stale \[s\].
    pub stale_after_s: Vec<f64>,
    /// Rates and format.
    pub publish: PublishConfig,
}
