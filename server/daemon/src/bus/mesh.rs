//! Answers queries for the mesh, in chunks.

use std::sync::Arc;

use plica_geometry::export::glb_bytes;
use plica_geometry::{DisplaySurface, vertex_normals_into};
use plica_protocol::ENCODING_GLB;
use plica_protocol::chunk::{ChunkHeader, offset_of, piece};
use plica_protocol::rpc::ErrorReply;
use sha2::{Digest, Sha256};
use zenoh::Wait;
use zenoh::query::{Query, Queryable};

use super::error::BusError;
use super::guard::guarded;
use super::replies::{Content, Replies};
use super::shared::Shared;

pub(super) fn declare(shared: &Arc<Shared>, replies: Replies) -> Result<Queryable<()>, BusError> {
    let mesh = Mesh::new(shared);
    let owner = Arc::clone(shared);
    let callback = guarded(&shared.counters, move |query: Query| {
        let content = mesh.answer(&owner, &query);
        replies.send(query, content);
    });
    let queryable = shared.session.declare_queryable(shared.keys.mesh("*")).callback(callback);
    queryable.wait().map_err(|e| shared.error(e))
}

/// The GLB and its checksum.
struct Mesh {
    key: String,
    glb: Vec<u8>,
    sha256: String,
}

impl Mesh {
    fn new(shared: &Shared) -> Self {
        let skin = &shared.model.description().skin;
        let surface = DisplaySurface::new(skin);
        let mut normals = vec![[0.0; 3]; surface.rest.len()];
        vertex_normals_into(&surface.triangles, &surface.rest, &mut normals);
        let glb = glb_bytes(&surface.rest, &normals, skin.triangles());
        let sha256 = plica_training::hexadecimal(&Sha256::digest(&glb));
        Self { key: shared.keys.mesh(&shared.scene.object), glb, sha256 }
    }

    fn answer(&self, shared: &Shared, query: &Query) -> Result<Content, ErrorReply> {
        if let Some(error) = shared.unknown_object(query.key_expr().as_str()) {
            return Err(error);
        }
        let offset = offset_of(query.parameters().as_str())?;
        let header = ChunkHeader { total_bytes: self.glb.len() as u64, offset, sha256: self.sha256.clone() };
        Ok(Content {
            key: self.key.clone(),
            payload: piece(&self.glb, offset)?.to_vec(),
            encoding: ENCODING_GLB,
            attachment: Some(header.to_json()),
        })
    }
}
