//! The pre-computation phase of Plica: interactions, the tandem solve, and the database of examples.
