/* How the site's search ranks: what a reader wants to do stands before how it was decided, a heading before its text.

Sphinx reads this file in place of its own numbers (html_search_scorer). `Scorer.score` gets each hit as
[page, title, anchor, description, score, file, kind] and may set its title and anchor, so a hit opens at the heading
that holds half of the words or more. `splitQuery` is Sphinx's hook for the words of a query: "how do I" is left out,
and so is a word that no page has or that leaves no page, for Sphinx wants a page to have all of them. */

var PLACES = [
  // The first that the page's name begins with. A heading with all words counts 60, so a place is less than a heading.
  ["how-to/index", 2],
  ["how-to/", 30],
  ["start", 26],
  ["reference/api", 4],
  ["reference/commands", 16],
  ["reference/", 20],
  ["course/", 18],
  ["gallery", 8],
  ["decisions/", -30],
];
var FILLERS = new Set(
  "a an and are as at be by can could do does for from get give have how i if in into is it its make me my need of on or"
    .concat(" our put should that the there this to up use using want what when where which why will with without you your")
    .split(" "),
);
var WORD = /[^\p{Letter}\p{Number}_\p{Emoji_Presentation}]+/gu;

var Scorer = {
  objNameMatch: 11,
  objPartialMatch: 6,
  objPrio: { 0: 5, 1: 2, 2: -5 },
  objPrioDefault: 0,
  title: 15,
  partialTitle: 7,
  term: 5,
  partialTerm: 2,

  score: (hit) => {
    const [page, , anchor, , score, , kind] = hit;
    const place = PLACES.find(([start]) => page.startsWith(start));
    const words = stemsOf(new URLSearchParams(window.location.search).get("q") || "");
    let best = { share: 0, title: "", id: null };
    for (const heading of headingsOf(page)) {
      const inHeading = stemsOf(heading.title);
      const found = words.filter((word) => inHeading.includes(word)).length / Math.max(words.length, 1);
      // Of two headings with the same words the shorter one says less besides.
      const share = found - 0.01 * Math.min(inHeading.length, 20) * (found > 0);
      if (share > best.share) best = { share, ...heading };
    }
    if (kind === "text" && best.share > 0.45 && best.id !== null && anchor === "" && best.title !== hit[1]) {
      hit[1] = `${hit[1]} > ${best.title}`;
      hit[2] = `#${best.id}`;
    }
    // A term of the glossary counts 100 of itself: less than a heading of how-to with the same words.
    const own = kind === "index" ? score / 2 : score;
    return own + (place ? place[1] : 0) + (kind === "object" ? 0 : 60 * best.share);
  },
};

function stemsOf(text) {
  const stemmer = new Stemmer();
  const words = text.toLowerCase().split(WORD).filter((word) => word && !FILLERS.has(word));
  return [...new Set(words.map((word) => stemmer.stemWord(word)))];
}

var headings = null;
/** The headings of a page, each {title, id}; id is null for the page's own. */
function headingsOf(page) {
  if (headings === null) {
    headings = new Map(Search._index.docnames.map((name) => [name, []]));
    for (const [title, places] of Object.entries(Search._index.alltitles))
      for (const [file, id] of places) headings.get(Search._index.docnames[file]).push({ title, id });
  }
  return headings.get(page) || [];
}

/** The pages that have a word in text or headings, as Sphinx finds them: whole, else as a part of another word. */
function pagesWith(word) {
  const pages = new Set();
  for (const terms of [Search._index.terms, Search._index.titleterms]) {
    const alike = Object.hasOwn(terms, word)
      ? [word]
      : word.length > 2 ? Object.keys(terms).filter((term) => term.includes(word)) : [];
    for (const term of alike) for (const page of [terms[term]].flat()) pages.add(page);
  }
  return pages;
}

function pagesWithAll(words) {
  const [first, ...others] = words.map(pagesWith);
  return [...first].filter((page) => others.every((pages) => pages.has(page)));
}

var splitQuery = (query) => {
  const all = query.split(WORD).filter((word) => word);
  let kept = all.filter((word) => !FILLERS.has(word.toLowerCase()) && !stopwords.has(word.toLowerCase()));
  if (kept.length === 0 || !Search.hasIndex()) return kept.length ? kept : all;
  const stemmer = new Stemmer();
  const stem = (word) => stemmer.stemWord(word.toLowerCase());
  const known = kept.filter((word) => pagesWith(stem(word)).size > 0);
  if (known.length === 0) return kept;
  kept = known;
  while (kept.length > 1 && pagesWithAll(kept.map(stem)).length === 0) {
    // The word that most pages have says least: leave it out, unless the others share no page either.
    const byPages = kept.map((word) => [word, pagesWith(stem(word)).size]).sort((a, b) => b[1] - a[1]);
    const others = (word) => kept.filter((each) => each !== word);
    const [out] = byPages.find(([word]) => pagesWithAll(others(word).map(stem)).length > 0) || byPages[0];
    kept = others(out);
  }
  return kept;
};
