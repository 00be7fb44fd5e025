using System;
using System.Collections.Generic;
using System.Globalization;
using System.Text;

/// What is no JSON by JSN-1 to JSN-5.
class NoJson : Exception { }

/// A number keeps its spelling, with which it is given back.
class Number
{
    public double Value;
    public string Spelled;
}

/// A reader of JSON that takes what RFC 8259 allows, and no more.
class Json
{
    const int Deepest = 64;
    static readonly UTF8Encoding Strict = new UTF8Encoding(false, true);
    readonly string text;
    int at;

    Json(string text) { this.text = text; }

    public static object Read(byte[] payload)
    {
        string text;
        try { text = Strict.GetString(payload); }
        catch (ArgumentException) { throw new NoJson(); }
        var reader = new Json(text);
        var value = reader.Value(0);
        reader.Space();
        if (reader.at != text.Length) throw new NoJson();
        return value;
    }

    char Next { get { return at < text.Length ? text[at] : '\0'; } }

    void Space() { while (at < text.Length && " \t\n\r".IndexOf(text[at]) >= 0) at++; }

    bool Take(string word)
    {
        if (string.CompareOrdinal(text, at, word, 0, word.Length) != 0) return false;
        at += word.Length;
        return true;
    }

    void Must(string word) { if (!Take(word)) throw new NoJson(); }

    object Value(int depth)
    {
        Space();
        if (Take("true")) return true;
        if (Take("false")) return false;
        if (Take("null")) return null;
        if (Next == '"') return String();
        if (Next != '{' && Next != '[') return Numeral();
        if (depth == Deepest) throw new NoJson();
        return Next == '{' ? (object)Object(depth) : List(depth);
    }

    Dictionary<string, object> Object(int depth)
    {
        var found = new Dictionary<string, object>(StringComparer.Ordinal);
        Must("{");
        Space();
        if (Take("}")) return found;
        do
        {
            Space();
            var name = String();
            Space();
            Must(":");
            if (found.ContainsKey(name)) throw new NoJson();
            found[name] = Value(depth + 1);
            Space();
        } while (Take(","));
        Must("}");
        return found;
    }

    List<object> List(int depth)
    {
        var found = new List<object>();
        Must("[");
        Space();
        if (Take("]")) return found;
        do { found.Add(Value(depth + 1)); Space(); } while (Take(","));
        Must("]");
        return found;
    }

    string String()
    {
        var found = new StringBuilder();
        for (Must("\""); Next != '"'; at++)
        {
            if (at >= text.Length || Next < ' ') throw new NoJson();
            if (Next != '\\') { found.Append(Next); continue; }
            at++;
            int plain = Next == '\0' ? -1 : "\"\\/bfnrt".IndexOf(Next);
            if (plain >= 0) { found.Append("\"\\/\b\f\n\r\t"[plain]); continue; }
            ushort code;
            if (Next != 'u' || at + 5 > text.Length || !Hexadecimal(text.Substring(at + 1, 4), out code)) throw new NoJson();
            found.Append((char)code);
            at += 4;
        }
        at++;
        var value = found.ToString();
        try { Strict.GetByteCount(value); }
        catch (ArgumentException) { throw new NoJson(); } // half a surrogate pair
        return value;
    }

    static bool Hexadecimal(string digits, out ushort code)
    {
        return ushort.TryParse(digits, NumberStyles.AllowHexSpecifier, CultureInfo.InvariantCulture, out code);
    }

    void Digits()
    {
        int from = at;
        while (Next >= '0' && Next <= '9') at++;
        if (at == from) throw new NoJson();
    }

    Number Numeral()
    {
        int from = at;
        double value;
        Take("-");
        if (!Take("0")) Digits();
        if (Take(".")) Digits();
        if (Take("e") || Take("E"))
        {
            if (!Take("+")) Take("-");
            Digits();
        }
        var spelled = text.Substring(from, at - from);
        if (!double.TryParse(spelled, NumberStyles.Float, CultureInfo.InvariantCulture, out value)
            || double.IsInfinity(value)) throw new NoJson();
        return new Number { Value = value, Spelled = spelled };
    }

    /// A string as JSON.
    public static string Quoted(string value)
    {
        var found = new StringBuilder("\"");
        foreach (var c in value)
            if (c == '"' || c == '\\') found.Append('\\').Append(c);
            else if (c < ' ') found.AppendFormat("\\u{0:x4}", (int)c);
            else found.Append(c);
        return found.Append('"').ToString();
    }
}
