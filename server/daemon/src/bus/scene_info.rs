//! Names, rates and formats of the served scene.

use plica_scene::scene::PublishConfig;

/// Names, rates and formats of the served scene.
#[derive(Debug, Clone)]
pub struct SceneInfo {
    /// Name of the scene.
    pub name: String,
    /// Name of the object.
    pub object: String,
    /// The tools, in the model's order.
    pub tools: Vec<ToolInfo>,
    /// Rates and format.
    pub publish: PublishConfig,
}

/// A tool and the poses that it takes.
#[derive(Debug, Clone)]
pub struct ToolInfo {
    /// Name of the tool.
    pub name: String,
    /// Age at which it is stale \[s\].
    pub stale_after_s: f64,
    /// Factor on tracked positions; poses are judged after it.
    pub position_scale: f64,
    /// How it follows its poses, as in the scene: `latest` or `interpolate`.
    pub sampling: &'static str,
}
