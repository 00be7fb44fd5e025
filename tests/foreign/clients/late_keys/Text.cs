// Reads JSON as it has to be, and nothing else.
using System;
using System.Collections.Generic;
using System.Globalization;
using System.Text;
using System.Text.RegularExpressions;

public sealed class Unreadable : Exception { public Unreadable(string what) : base(what) { } }

public sealed class Text
{
    static readonly Regex Number = new Regex(@"\G-?(0|[1-9][0-9]*)(\.[0-9]+)?([eE][+-]?[0-9]+)?");
    readonly string text;
    int at;

    Text(string text) { this.text = text; }

    public static Dictionary<string, object> Read(byte[] payload)
    {
        string text;
        try { text = new UTF8Encoding(false, true).GetString(payload); }
        catch (ArgumentException) { throw new Unreadable("no UTF-8"); }
        var reader = new Text(text);
        var value = reader.Value(0) as Dictionary<string, object>;
        reader.Space();
        if (value == null || reader.at < text.Length) throw new Unreadable("no object");
        return value;
    }

    void Space() { while (at < text.Length && " \t\r\n".IndexOf(text[at]) >= 0) at++; }

    char Next()
    {
        Space();
        if (at >= text.Length) throw new Unreadable("it ends too soon");
        return text[at];
    }

    void Expect(char wanted)
    {
        if (Next() != wanted) throw new Unreadable("no " + wanted);
        at++;
    }

    object Value(int depth)
    {
        switch (Next())
        {
            case '{': return Object(depth + 1);
            case '[': return Array(depth + 1);
            case '"': return String();
            case 't': return Word("true", true);
            case 'f': return Word("false", false);
            case 'n': return Word("null", null);
        }
        var match = Number.Match(text, at);
        if (!match.Success) throw new Unreadable("no value");
        at += match.Length;
        double value;
        if (!double.TryParse(match.Value, NumberStyles.Float, CultureInfo.InvariantCulture, out value)
            || double.IsInfinity(value) || double.IsNaN(value))
            throw new Unreadable("a number out of range");
        return value;
    }

    object Word(string word, object value)
    {
        if (string.CompareOrdinal(text, at, word, 0, word.Length) != 0) throw new Unreadable("no word");
        at += word.Length;
        return value;
    }

    object Object(int depth)
    {
        if (depth > 64) throw new Unreadable("too deep");
        var members = new Dictionary<string, object>(StringComparer.Ordinal);
        at++;
        if (Next() == '}') { at++; return members; }
        while (true)
        {
            if (Next() != '"') throw new Unreadable("no name");
            var name = String();
            Expect(':');
            if (members.ContainsKey(name)) throw new Unreadable("a name twice");
            members[name] = Value(depth);
            if (Next() == '}') { at++; return members; }
            Expect(',');
        }
    }

    object Array(int depth)
    {
        if (depth > 64) throw new Unreadable("too deep");
        var values = new List<object>();
        at++;
        if (Next() == ']') { at++; return values; }
        while (true)
        {
            values.Add(Value(depth));
            if (Next() == ']') { at++; return values; }
            Expect(',');
        }
    }

    string String()
    {
        var built = new StringBuilder();
        for (at++; ; at++)
        {
            if (at >= text.Length || text[at] < ' ') throw new Unreadable("a string without end");
            if (text[at] == '"') break;
            if (text[at] != '\\') { built.Append(text[at]); continue; }
            if (++at >= text.Length) throw new Unreadable("a string without end");
            int plain = "\"\\/bfnrt".IndexOf(text[at]);
            if (plain >= 0) { built.Append("\"\\/\b\f\n\r\t"[plain]); continue; }
            ushort unit;
            if (text[at] != 'u' || at + 4 >= text.Length || !ushort.TryParse(text.Substring(at + 1, 4),
                NumberStyles.AllowHexSpecifier, CultureInfo.InvariantCulture, out unit))
                throw new Unreadable("no escape");
            built.Append((char)unit);
            at += 4;
        }
        at++;
        for (int i = 0; i < built.Length; i++)
        {
            if (!char.IsSurrogate(built[i])) continue;
            if (i + 1 >= built.Length || !char.IsSurrogatePair(built[i], built[i + 1])) throw new Unreadable("half a pair");
            i++;
        }
        return built.ToString();
    }
}
