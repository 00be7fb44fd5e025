// JSON as SplatBus wants it; anything else is a FormatException.
using System;
using System.Collections.Generic;
using System.Globalization;
using System.Text;
using System.Text.RegularExpressions;

class Json
{
    static readonly Regex Word = new Regex(@"\G(null|true|false|-?(0|[1-9][0-9]*)(\.[0-9]+)?([eE][-+]?[0-9]+)?)");
    static readonly Regex Quoted = new Regex(@"\G""((?:[^""\\\x00-\x1f]|\\[""\\/bfnrt]|\\u[0-9a-fA-F]{4})*)""");
    readonly string text;
    int at;

    Json(string text) { this.text = text; }

    public static Dictionary<string, object> Object(byte[] payload)
    {
        try
        {
            var json = new Json(new UTF8Encoding(false, true).GetString(payload));
            var root = json.Value(1) as Dictionary<string, object>;
            json.Need(root != null && json.Next() == '\0' && json.at == json.text.Length);
            return root;
        }
        catch (ArgumentException) { throw new FormatException("no UTF-8, or a name twice"); }
    }

    void Need(bool fact) { if (!fact) throw new FormatException("no JSON at " + at); }

    char Next()
    {
        while (at < text.Length && " \t\r\n".IndexOf(text[at]) >= 0) at++;
        return at < text.Length ? text[at] : '\0';
    }

    string Take(Regex pattern, int group)
    {
        Match found = pattern.Match(text, at);
        Need(found.Success);
        at += found.Length;
        return found.Groups[group].Value;
    }

    object Value(int depth)
    {
        char first = Next();
        if (first == '"') return Text();
        if (first != '{' && first != '[')
        {
            string word = Take(Word, 0);
            if (word[0] == 'n') return null;
            if (word[0] == 't' || word[0] == 'f') return word[0] == 't';
            double value;
            Need(double.TryParse(word, NumberStyles.Float, CultureInfo.InvariantCulture, out value) && !double.IsInfinity(value));
            return value;
        }
        Need(depth <= 64);
        var members = new Dictionary<string, object>(StringComparer.Ordinal);
        var items = new List<object>();
        char close = first == '{' ? '}' : ']';
        at++;
        if (Next() == close) at++;
        else
            for (bool more = true; more; at++)
            {
                Next();
                string name = first == '{' ? Text() : null;
                if (first == '{') { Need(Next() == ':'); at++; }
                object value = Value(depth + 1);
                if (first == '{') members.Add(name, value); else items.Add(value);
                more = Next() == ',';
                Need(more || Next() == close);
            }
        return first == '{' ? (object)members : items;
    }

    string Text()
    {
        string whole = Regex.Unescape(Take(Quoted, 1));
        for (int i = 0; i < whole.Length; i++)
            if (char.IsSurrogate(whole[i])) Need(++i < whole.Length && char.IsSurrogatePair(whole, i - 1));
        return whole;
    }
}
