//! Words of the glossary in `server/MATH.md` that comments and messages do not use.

/// A word with the term that stands in its place.
pub struct HouseWord {
    /// In lower case, as whole words.
    pub word: &'static str,
    /// The term of the glossary.
    pub term: &'static str,
    /// Uses that are left. The number only falls; at 0 the word is gone for good.
    pub n_left: usize,
}

/// Words that mean nothing else in this code.
pub const HOUSE_WORDS: [HouseWord; 6] = [
    HouseWord { word: "likeness", term: "similarity", n_left: 2 },
    HouseWord { word: "firm", term: "sensitivity", n_left: 0 },
    HouseWord { word: "verdict", term: "evaluation", n_left: 0 },
    HouseWord { word: "taught", term: "trained on", n_left: 0 },
    HouseWord { word: "way to enrich", term: "enrichment method", n_left: 4 },
    HouseWord { word: "ways to enrich", term: "enrichment methods", n_left: 1 },
];

/// Lines of a source whose comment or string holds `word`, counted from 1. A string over several lines is not seen whole.
pub fn lines_with(source: &str, word: &str) -> Vec<usize> {
    let holds = |line: &str| has_word(&prose_of(line).to_lowercase(), word);
    source.lines().enumerate().filter(|(_, line)| holds(line)).map(|(i, _)| i + 1).collect()
}

/// Comment and strings of a line.
fn prose_of(line: &str) -> String {
    let (code, comment) = line.split_once("//").unwrap_or((line, ""));
    let strings: Vec<&str> = code.split('"').skip(1).step_by(2).collect();
    format!("{} {comment}", strings.join(" "))
}

fn has_word(prose: &str, word: &str) -> bool {
    let is_letter = |c: Option<char>| c.is_some_and(|c| c.is_alphanumeric() || c == '_');
    prose.match_indices(word).any(|(at, _)| {
        !is_letter(prose[..at].chars().next_back()) && !is_letter(prose[at + word.len()..].chars().next())
    })
}
