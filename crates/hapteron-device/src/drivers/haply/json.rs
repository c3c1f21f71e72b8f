//! A reader of JSON texts that builds nothing: it walks through objects and arrays, hands out numbers and texts, and skips the rest. No allocation.

/// The text is no JSON, or not of the shape that was expected.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NotJson;

type Outcome<T> = Result<T, NotJson>;

/// Deepest nesting that is followed.
const DEPTH: u32 = 64;

/// A place in a text.
pub struct Json<'a> {
    text: &'a str,
    at: usize,
    depth: u32,
}

impl<'a> Json<'a> {
    /// At the start.
    #[must_use]
    pub fn new(text: &'a str) -> Self {
        Self { text, at: 0, depth: 0 }
    }

    /// The first byte of the next value, after blanks; 0 at the end.
    pub fn peek(&mut self) -> u8 {
        let bytes = self.text.as_bytes();
        while let Some(b' ' | b'\t' | b'\n' | b'\r') = bytes.get(self.at) {
            self.at += 1;
        }
        bytes.get(self.at).copied().unwrap_or(0)
    }

    fn byte(&self) -> u8 {
        self.text.as_bytes().get(self.at).copied().unwrap_or(0)
    }

    fn expect(&mut self, byte: u8) -> Outcome<()> {
        if self.peek() != byte {
            return Err(NotJson);
        }
        self.at += 1;
        Ok(())
    }

    /// Whether the whole text has been read.
    ///
    /// # Errors
    /// Something is left.
    pub fn end(&mut self) -> Outcome<()> {
        if self.peek() == 0 && self.at == self.text.len() { Ok(()) } else { Err(NotJson) }
    }

    fn list(
        &mut self,
        [open, close]: [u8; 2],
        mut each: impl FnMut(&mut Self) -> Outcome<()>,
    ) -> Outcome<()> {
        self.expect(open)?;
        self.depth += 1;
        if self.depth > DEPTH {
            return Err(NotJson);
        }
        if self.peek() != close {
            loop {
                each(self)?;
                if self.peek() != b',' {
                    break;
                }
                self.at += 1;
            }
        }
        self.depth -= 1;
        self.expect(close)
    }

    /// An object: `each` gets every key and must read its value.
    ///
    /// # Errors
    /// No object, or an error of `each`.
    pub fn object(&mut self, mut each: impl FnMut(&'a str, &mut Self) -> Outcome<()>) -> Outcome<()> {
        self.list([b'{', b'}'], |json| {
            let key = json.string()?;
            json.expect(b':')?;
            each(key, json)
        })
    }

    /// An array: `each` must read every element.
    ///
    /// # Errors
    /// No array, or an error of `each`.
    pub fn array(&mut self, each: impl FnMut(&mut Self) -> Outcome<()>) -> Outcome<()> {
        self.list([b'[', b']'], each)
    }

    /// A text, as written: escapes are checked and left as they are.
    ///
    /// # Errors
    /// No text.
    pub fn string(&mut self) -> Outcome<&'a str> {
        self.expect(b'"')?;
        let start = self.at;
        loop {
            match self.byte() {
                b'"' => break,
                b'\\' => self.escape()?,
                0..0x20 => return Err(NotJson),
                _ => self.at += 1,
            }
        }
        self.at += 1;
        self.text.get(start..self.at - 1).ok_or(NotJson)
    }

    fn escape(&mut self) -> Outcome<()> {
        self.at += 1;
        let kind = self.byte();
        self.at += 1;
        match kind {
            b'"' | b'\\' | b'/' | b'b' | b'f' | b'n' | b'r' | b't' => Ok(()),
            b'u' => match self.hexadecimal()? {
                0xDC00..0xE000 => Err(NotJson),
                0xD800..0xDC00 => {
                    if self.text.as_bytes().get(self.at..self.at + 2) != Some(b"\\u") {
                        return Err(NotJson);
                    }
                    self.at += 2;
                    if matches!(self.hexadecimal()?, 0xDC00..0xE000) { Ok(()) } else { Err(NotJson) }
                }
                _ => Ok(()),
            },
            _ => Err(NotJson),
        }
    }

    fn hexadecimal(&mut self) -> Outcome<u32> {
        let digits = self.text.get(self.at..self.at + 4).ok_or(NotJson)?;
        if !digits.bytes().all(|b| b.is_ascii_hexdigit()) {
            return Err(NotJson);
        }
        self.at += 4;
        u32::from_str_radix(digits, 16).map_err(|_| NotJson)
    }

    fn digits(&mut self) -> Outcome<()> {
        if !self.byte().is_ascii_digit() {
            return Err(NotJson);
        }
        while self.byte().is_ascii_digit() {
            self.at += 1;
        }
        Ok(())
    }

    /// A finite number.
    ///
    /// # Errors
    /// No number, or one that is too large.
    pub fn number(&mut self) -> Outcome<f64> {
        self.peek();
        let start = self.at;
        if self.byte() == b'-' {
            self.at += 1;
        }
        if self.byte() == b'0' {
            self.at += 1;
        } else {
            self.digits()?;
        }
        if self.byte() == b'.' {
            self.at += 1;
            self.digits()?;
        }
        if let b'e' | b'E' = self.byte() {
            self.at += 1;
            if let b'+' | b'-' = self.byte() {
                self.at += 1;
            }
            self.digits()?;
        }
        let number: f64 = self.text.get(start..self.at).ok_or(NotJson)?.parse().map_err(|_| NotJson)?;
        if number.is_finite() { Ok(number) } else { Err(NotJson) }
    }

    /// `true` or `false`.
    ///
    /// # Errors
    /// Neither.
    pub fn boolean(&mut self) -> Outcome<bool> {
        match self.peek() {
            b't' => self.word("true").map(|()| true),
            _ => self.word("false").map(|()| false),
        }
    }

    fn word(&mut self, word: &str) -> Outcome<()> {
        self.peek();
        if !self.text.get(self.at..).is_some_and(|rest| rest.starts_with(word)) {
            return Err(NotJson);
        }
        self.at += word.len();
        Ok(())
    }

    /// Any value, checked and left out.
    ///
    /// # Errors
    /// No value.
    pub fn skip(&mut self) -> Outcome<()> {
        match self.peek() {
            b'{' => self.object(|_, json| json.skip()),
            b'[' => self.array(Self::skip),
            b'"' => self.string().map(drop),
            b't' | b'f' => self.boolean().map(drop),
            b'n' => self.word("null"),
            _ => self.number().map(drop),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn accepted(text: &str) -> bool {
        let mut json = Json::new(text);
        json.skip().and_then(|()| json.end()).is_ok()
    }

    /// JSON values that are nested a few times.
    fn values() -> impl Strategy<Value = serde_json::Value> {
        let leaf = prop_oneof![
            Just(serde_json::Value::Null),
            any::<bool>().prop_map(Into::into),
            any::<f64>().prop_filter("finite", |x| x.is_finite()).prop_map(Into::into),
            any::<i64>().prop_map(Into::into),
            any::<String>().prop_map(Into::into),
        ];
        leaf.prop_recursive(4, 40, 6, |inner| {
            prop_oneof![
                prop::collection::vec(inner.clone(), 0..6).prop_map(Into::into),
                prop::collection::btree_map(any::<String>(), inner, 0..6)
                    .prop_map(|m| serde_json::Value::Object(m.into_iter().collect())),
            ]
        })
    }

    proptest! {
        /// Guards the grammar against serde_json: whole texts, and texts with a byte changed, cut or doubled.
        #[test]
        fn accepts_what_serde_json_accepts(value in values(), place in any::<prop::sample::Index>(), byte in prop::sample::select(&b"{}[]\",:0123456789.eE+-\\u \ntfn"[..]), change in 0..4) {
            let mut bytes = value.to_string().into_bytes();
            let at = place.index(bytes.len());
            match change {
                0 => {}
                1 => bytes[at] = byte,
                2 => bytes.insert(at, byte),
                _ => { bytes.remove(at); }
            }
            let Ok(text) = String::from_utf8(bytes) else { return Ok(()) };
            prop_assert_eq!(accepted(&text), serde_json::from_str::<serde_json::Value>(&text).is_ok(), "{}", text);
        }

        /// Guards numbers, bit for bit.
        #[test]
        fn numbers_are_exact(x in any::<f64>().prop_filter("finite", |x| x.is_finite())) {
            let text = serde_json::Value::from(x).to_string();
            prop_assert_eq!(Json::new(&text).number().unwrap().to_bits(), x.to_bits());
        }
    }

    /// Guards against a stack overflow by nesting.
    #[test]
    fn deep_nesting_is_refused() {
        assert!(accepted(&("[".repeat(60) + &"]".repeat(60))));
        assert!(!accepted(&"[".repeat(1_000_000)));
    }
}
