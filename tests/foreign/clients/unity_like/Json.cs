// JSON as SplatBus wants it; anything else is a FormatException.
using System;
using System.Collections.Generic;
using System.Globalization;
using System.Text;

class Json
{
    readonly string text;
    int at;

    Json(string text) { this.text = text; }

    public static Dictionary<string, object> Object(byte[] payload)
    {
        string text;
        try { text = new UTF8Encoding(false, true).GetString(payload); }
        catch (ArgumentException) { throw new FormatException("no UTF-8"); }
        var json = new Json(text);
        var root = json.Value(1) as Dictionary<string, object>;
        json.Blank();
        if (root == null || json.at != text.Length) throw new FormatException("no object");
        return root;
    }

    char Here { get { return at < text.Length ? text[at] : '\0'; } }

    void Blank() { while (Here == ' ' || Here == '\t' || Here == '\n' || Here == '\r') at++; }

    void Want(char wanted)
    {
        Blank();
        if (Here != wanted) throw new FormatException("no " + wanted);
        at++;
    }

    object Value(int depth)
    {
        Blank();
        if (depth > 64 && (Here == '{' || Here == '[')) throw new FormatException("too deep");
        if (Here == '{') return Members(depth);
        if (Here == '[') return Items(depth);
        if (Here == '"') return Text();
        if (Word("null")) return null;
        if (Word("true")) return true;
        if (Word("false")) return false;
        return Number();
    }

    bool Word(string word)
    {
        if (string.CompareOrdinal(text, at, word, 0, word.Length) != 0) return false;
        at += word.Length;
        return true;
    }

    Dictionary<string, object> Members(int depth)
    {
        var members = new Dictionary<string, object>(StringComparer.Ordinal);
        at++;
        Blank();
        if (Here == '}') { at++; return members; }
        for (;;)
        {
            Blank();
            string name = Text();
            Want(':');
            if (members.ContainsKey(name)) throw new FormatException("a name twice");
            members[name] = Value(depth + 1);
            Blank();
            if (Here == '}') { at++; return members; }
            Want(',');
        }
    }

    List<object> Items(int depth)
    {
        var items = new List<object>();
        at++;
        Blank();
        if (Here == ']') { at++; return items; }
        for (;;)
        {
            items.Add(Value(depth + 1));
            Blank();
            if (Here == ']') { at++; return items; }
            Want(',');
        }
    }

    string Text()
    {
        var made = new StringBuilder();
        if (Here != '"') throw new FormatException("no string");
        for (at++; Here != '"'; at++)
        {
            if (Here < ' ') throw new FormatException("a control character, or no end");
            if (Here != '\\') { made.Append(Here); continue; }
            at++;
            int plain = "\"\\/bfnrt".IndexOf(Here);
            if (plain >= 0) { made.Append("\"\\/\b\f\n\r\t"[plain]); continue; }
            if (Here != 'u' || at + 4 >= text.Length) throw new FormatException("no escape");
            int code = 0;
            for (int i = 1; i <= 4; i++)
            {
                int digit = "0123456789abcdef".IndexOf(char.ToLowerInvariant(text[at + i]));
                if (digit < 0) throw new FormatException("no escape");
                code = 16 * code + digit;
            }
            made.Append((char)code);
            at += 4;
        }
        at++;
        string whole = made.ToString();
        for (int i = 0; i < whole.Length; i++)
        {
            if (!char.IsSurrogate(whole[i])) continue;
            if (i + 1 == whole.Length || !char.IsSurrogatePair(whole, i)) throw new FormatException("half a pair");
            i++;
        }
        return whole;
    }

    void Digits()
    {
        int from = at;
        while (Here >= '0' && Here <= '9') at++;
        if (at == from) throw new FormatException("no digits");
    }

    double Number()
    {
        int from = at;
        if (Here == '-') at++;
        if (Here == '0') at++; else Digits();
        if (Here == '.') { at++; Digits(); }
        if (Here == 'e' || Here == 'E')
        {
            at++;
            if (Here == '+' || Here == '-') at++;
            Digits();
        }
        double value;
        if (!double.TryParse(text.Substring(from, at - from), NumberStyles.Float, CultureInfo.InvariantCulture, out value)
            || double.IsInfinity(value) || double.IsNaN(value)) throw new FormatException("no finite number");
        return value;
    }
}
